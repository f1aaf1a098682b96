// The room in three dimensions: a lazy chunk, so that the page opens without it.
import "@kitware/vtk.js/Rendering/OpenGL/Profiles/Geometry";
import "@kitware/vtk.js/Rendering/OpenGL/Profiles/Volume";

import vtkDataArray from "@kitware/vtk.js/Common/Core/DataArray";
import vtkPoints from "@kitware/vtk.js/Common/Core/Points";
import vtkCellArray from "@kitware/vtk.js/Common/Core/CellArray";
import vtkImageData from "@kitware/vtk.js/Common/DataModel/ImageData";
import vtkPiecewiseFunction from "@kitware/vtk.js/Common/DataModel/PiecewiseFunction";
import vtkPolyData from "@kitware/vtk.js/Common/DataModel/PolyData";
import vtkImageMarchingCubes from "@kitware/vtk.js/Filters/General/ImageMarchingCubes";
import vtkOutlineFilter from "@kitware/vtk.js/Filters/General/OutlineFilter";
import vtkActor from "@kitware/vtk.js/Rendering/Core/Actor";
import vtkColorTransferFunction from "@kitware/vtk.js/Rendering/Core/ColorTransferFunction";
import vtkMapper from "@kitware/vtk.js/Rendering/Core/Mapper";
import vtkVolume from "@kitware/vtk.js/Rendering/Core/Volume";
import vtkVolumeMapper from "@kitware/vtk.js/Rendering/Core/VolumeMapper";
import vtkGenericRenderWindow from "@kitware/vtk.js/Rendering/Misc/GenericRenderWindow";
import type { Numbers } from "./api";
import { stops, table, type Scale } from "./colour";
import { arrows, speedLimit, streamlines, type Grid, type Lines } from "./flow";
import { placed } from "./labels";
import { boxesOf, type Opening, type Vector } from "./room";
import { Strokes, type Screen } from "./strokes";
import { ticksOf } from "./ticks";

export type Axis = "x" | "y" | "z";
export const AXES: readonly Axis[] = ["x", "y", "z"];

/** What is shown; x, y and z are the planes across them. */
export interface Modes extends Record<Axis, boolean> {
  volume: boolean;
  surface: boolean;
  arrows: boolean;
  streamlines: boolean;
}

export const VIEWS = {
  Corner: [-0.55, -1, 0.45],
  Front: [0, -1, 0],
  Side: [1, 0, 0],
  Top: [0, -0.001, 1],
} as const;

/** What stands in the room and before it. */
export interface Stands {
  openings: Opening[];
  camera: Vector | null;
}

/** A scale as it is written on a picture that is kept: what it is of, and its ends. */
export interface Legend {
  kind: Scale["kind"];
  text: string;
  ends: [string, string];
}

export interface Scene3d {
  /** Takes what is shown; the fastest speed [m/s] is given back where velocity is known. */
  load(values: Numbers, velocity: Numbers[] | null, axes: Grid["axes"], scale: Scale, stands: Stands): number;
  /** `level` and `cuts` are shares: of the scale for the isosurface, of the room along an axis for its plane. */
  show(modes: Modes, level: number, cuts: Record<Axis, number>): void;
  look(from: keyof typeof VIEWS): void;
  move(on: boolean): void;
  /** As it is seen, with its scales. */
  picture(legends: Legend[]): Promise<string>;
  /** A film of so many seconds; null where the browser cannot make one. */
  film(seconds: number, legends: Legend[]): Promise<Blob | null>;
  /** The place on the nearest shown plane under a pixel of the view, in metres; null beside it. */
  under(x_px: number, y_px: number): Vector | null;
  /** Where one looks from: position, focus and what is up, in nine numbers. */
  seen(): number[];
  see(from: number[]): void;
  close(): void;
}

// Voxels from sample to sample along a ray, finest first; the first that is fast enough is kept.
const STRIDES = [1.5, 2.2, 3.2] as const;
const SMOOTH_MS = 90;
// Words over the dark picture, and what is behind names.
const INK = "#dfe5ea";
const BEHIND_NAMES = "#14171cb3";
// Room air crosses a room in half a minute: shown so many times as fast, each stroke as long as it goes in this time.
const FASTER = 4;
const TAIL_S = 3;
const FRAME_MS = 33;
// A way along which a plane is dragged is at least so long on the screen.
const SHORTEST_PX = 12;
// How far below the middle of the room one looks from the corner, in halves of its height.
const LOWER = 0.2;
const OPENINGS = {
  inlet: [0.45, 0.85, 1],
  outlet: [1, 0.75, 0.4],
  heater: [1, 0.45, 0.4],
  object: [0.6, 0.6, 0.62],
} as const;

/** `dragged` hears the share of the room at which a plane's grip is held. */
export function createScene(place: HTMLElement, dragged: (axis: Axis, share: number) => void): Scene3d {
  const view = vtkGenericRenderWindow.newInstance({ background: [0.08, 0.09, 0.11], listenWindowResize: false });
  view.setContainer(place as HTMLDivElement);
  const renderer = view.getRenderer();
  const window3d = view.getRenderWindow();
  const watch = new ResizeObserver(() => {
    view.resize();
    put();
  });
  watch.observe(place);
  view.resize();

  const volume = vtkVolume.newInstance();
  const volumeMapper = vtkVolumeMapper.newInstance();
  volume.setMapper(volumeMapper);
  const cubes = vtkImageMarchingCubes.newInstance({ computeNormals: true, mergePoints: true });
  const surface = actorOf(cubes.getOutputPort());
  surface.getProperty().setOpacity(0.7);
  const [arrowActor, lineActor] = [0, 1].map(() => vtkActor.newInstance()) as Actor[];
  const planes = { x: vtkActor.newInstance(), y: vtkActor.newInstance(), z: vtkActor.newInstance() };
  for (const axis of AXES) planes[axis].getProperty().setLighting(false);
  arrowActor!.getProperty().setLineWidth(2);
  lineActor!.getProperty().setLineWidth(1.5);
  // What moves along them is to be seen first.
  lineActor!.getProperty().setOpacity(0.4);
  const outline = vtkOutlineFilter.newInstance();
  const frame = actorOf(outline.getOutputPort());
  frame.getProperty().setColor(0.6, 0.65, 0.7);
  const onScreen = (at: Vector): [number, number] => {
    const { width, height } = place.getBoundingClientRect();
    const [x = 0, y = 0] = renderer.worldToNormalizedDisplay(at[0], at[1], at[2], width / Math.max(1, height));
    return [x * width, (1 - y) * height];
  };
  const marks = new Marks(place, () => projection());
  // What moves is drawn here; the room below it stays as it is until somebody turns or changes it.
  const sheet = document.createElement("canvas");
  sheet.className = "strokes";
  place.append(sheet);
  const pen = sheet.getContext("2d")!;
  const grips = { x: grip("x"), y: grip("y"), z: grip("z") };
  let walls: Actor[] = [];
  let scale: Scale = { low: 0, high: 1, kind: "rising" };
  let shown: { values: Numbers; axes: Grid["axes"] } | null = null;
  let strokes: Strokes | null = null;
  let boxes: Screen[] = [];
  let flows = false;
  let stride = 0;
  let voxel_m = 1;
  let timer = 0;
  let cuts: Record<Axis, number> = { x: 0.5, y: 0.5, z: 0.5 };

  /** What a plane is held by: a dot at one of its corners. By keyboard the plane has its slider. */
  function grip(axis: Axis): HTMLElement {
    const element = document.createElement("span");
    element.className = "grip";
    element.title = `Drag the plane along ${axis}`;
    element.hidden = true;
    element.onpointerdown = (event) => {
      event.stopPropagation();
      element.setPointerCapture(event.pointerId);
    };
    element.onpointermove = (event) => {
      if (!element.hasPointerCapture(event.pointerId)) return;
      event.stopPropagation();
      const box = place.getBoundingClientRect();
      const [from, to] = [onScreen(cornerOf(axis, 0)), onScreen(cornerOf(axis, 1))];
      const along = [to[0] - from[0], to[1] - from[1]] as const;
      const length = along[0] ** 2 + along[1] ** 2;
      // Seen end on, a plane has no way to go.
      if (length < SHORTEST_PX ** 2) return;
      const far = (event.clientX - box.left - from[0]) * along[0] + (event.clientY - box.top - from[1]) * along[1];
      dragged(axis, Math.max(0, Math.min(1, far / length)));
    };
    place.append(element);
    return element;
  }

  /** Where the grip of a plane is that lies at a share of the room. */
  function cornerOf(axis: Axis, share: number): Vector {
    const sides = { x: { y: 0, z: 1 }, y: { x: 1, z: 1 }, z: { x: 1, y: 0 } }[axis] as Partial<Record<Axis, number>>;
    return AXES.map((one) => {
      const places = shown?.axes[one] ?? [0, 1];
      const [low, high] = [places[0] ?? 0, places.at(-1) ?? 1];
      return low + (sides[one] ?? share) * (high - low);
    }) as Vector;
  }

  /** Puts words and grips where they belong. */
  function put(): void {
    marks.put();
    drawStrokes();
    for (const axis of AXES) {
      const [left, top] = onScreen(cornerOf(axis, cuts[axis]));
      grips[axis].style.transform = `translate(-50%, -50%) translate(${left.toFixed(1)}px, ${top.toFixed(1)}px)`;
    }
  }

  function load(
    values: Numbers,
    velocity: Numbers[] | null,
    axes: Grid["axes"],
    wanted: Scale,
    { openings, camera }: Stands,
  ): number {
    scale = wanted;
    const image = imageOf(values, axes, scale);
    volumeMapper.setInputData(image);
    voxel_m = Math.min(...image.getSpacing());
    volumeMapper.setSampleDistance((stride || STRIDES[0]) * voxel_m);
    volume.getProperty().setRGBTransferFunction(0, colourFunction(scale));
    volume.getProperty().setScalarOpacity(0, opacityFunction(scale));
    volume.getProperty().setInterpolationTypeToLinear();
    cubes.setInputData(image);
    outline.setInputData(image);
    const fastest = velocity ? flow({ axes, u: velocity[0]!, v: velocity[1]!, w: velocity[2]! }) : 0;
    for (const axis of AXES) planes[axis].setMapper(planeMapper(values, axes, axis, cuts[axis], scale));
    boxes = boxesOf(openings);
    walls = [...openings.map(openingOf), ...(camera ? [sightOf(camera, axes)] : [])];
    renderer.removeAllViewProps();
    renderer.addVolume(volume);
    // An actor that has nothing to draw yet cannot be rendered.
    for (const actor of [...Object.values(planes), surface, arrowActor!, lineActor!, frame, ...walls])
      if (actor.getMapper()) renderer.addActor(actor);
    // What is named first keeps its place.
    marks.set([
      ...openings.filter((one) => one.label).map(nameOf),
      ...(camera ? [cameraMark(camera, axes)] : []),
      ...axisMarks(axes),
    ]);
    const isFirst = shown === null;
    shown = { values, axes };
    if (isFirst) look("Corner");
    return fastest;
  }

  function flow(grid: Grid): number {
    const fastest = speedLimit(grid);
    const lines = streamlines(grid);
    strokes = new Strokes(lines, TAIL_S, fastest);
    arrowActor!.setMapper(linesMapper(linesData(arrows(grid)), fastest));
    lineActor!.setMapper(linesMapper(linesData(lines), fastest));
    return fastest;
  }

  function show(modes: Modes, level: number, at: Record<Axis, number>): void {
    cuts = at;
    if (!shown) return;
    for (const axis of AXES) {
      if (modes[axis]) planes[axis].setMapper(planeMapper(shown.values, shown.axes, axis, at[axis], scale));
      planes[axis].setVisibility(modes[axis]);
      grips[axis].hidden = !modes[axis];
    }
    volume.setVisibility(modes.volume);
    surface.setVisibility(modes.surface);
    arrowActor!.setVisibility(modes.arrows && strokes !== null);
    lineActor!.setVisibility(modes.streamlines && strokes !== null);
    flows = modes.streamlines && strokes !== null;
    const value = scale.low + level * (scale.high - scale.low);
    if (modes.surface) cubes.setContourValue(value);
    const colour: number[] = [0, 0, 0];
    colourFunction(scale).getColor(value, colour as [number, number, number]);
    surface.getProperty().setColor(colour[0]!, colour[1]!, colour[2]!);
    if (!stride && modes.volume) pace();
    const began_ms = performance.now();
    window3d.render();
    put();
    place.dataset["frameMs"] = (performance.now() - began_ms).toFixed(1);
  }

  function look(from: keyof typeof VIEWS): void {
    const camera = renderer.getActiveCamera();
    const [x, y, z] = outline.getOutputData().getCenter() as Vector;
    const [dx, dy, dz] = VIEWS[from];
    camera.setFocalPoint(x, y, z);
    camera.setPosition(x + dx, y + dy, z + dz);
    camera.setViewUp(0, 0, 1);
    renderer.resetCamera();
    if (from === "Corner") {
      // The words of the axes stand below the room: one looks a little lower.
      const heights = shown?.axes.z ?? [];
      const lower = (LOWER * ((heights.at(-1) ?? 0) - (heights[0] ?? 0))) / 2;
      const [[fx, fy, fz], [px, py, pz]] = [[...camera.getFocalPoint()] as Vector, [...camera.getPosition()] as Vector];
      camera.setFocalPoint(fx, fy, fz - lower);
      camera.setPosition(px, py, pz - lower);
    }
    // On a narrow screen the room's width is the limit.
    const isNarrow = place.clientWidth < 1.2 * place.clientHeight;
    camera.zoom(isNarrow ? 0.9 : from === "Corner" ? 1.18 : 1.3);
    renderer.resetCameraClippingRange();
    window3d.render();
    put();
  }

  function move(on: boolean): void {
    clearTimeout(timer);
    if (on) step();
  }

  function step(): void {
    const began_ms = performance.now();
    if (flows && !document.hidden) {
      drawStrokes();
      place.dataset["moved"] = String(Number(place.dataset["moved"] ?? 0) + 1);
    }
    // At least a fifth of the time is left free for everything else.
    const took_ms = performance.now() - began_ms;
    timer = window.setTimeout(step, Math.max(FRAME_MS - took_ms, took_ms / 4));
  }

  /** The strokes where they are now, over the room as it was drawn last. */
  function drawStrokes(): void {
    const { width, height } = place.getBoundingClientRect();
    const ratio = window.devicePixelRatio;
    const [columns, rows] = [Math.round(width * ratio), Math.round(height * ratio)];
    // A new size empties the sheet as well.
    if (sheet.width !== columns || sheet.height !== rows) [sheet.width, sheet.height] = [columns, rows];
    else pen.clearRect(0, 0, width, height);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    if (!strokes || !flows) return;
    const eye = [...renderer.getActiveCamera().getPosition()] as Vector;
    strokes.draw(pen, (FASTER * performance.now()) / 1000, { at: eye, onScreen: projection() }, screens());
  }

  /** Where places of the room are on the screen as it is seen now, by one matrix; null for those behind the eye. */
  function projection(): (at: Vector) => [number, number] | null {
    const { width, height } = place.getBoundingClientRect();
    const m = renderer.getActiveCamera().getCompositeProjectionMatrix(width / Math.max(1, height), -1, 1);
    const row = (n: number, [x, y, z]: Vector) => m[n]! * x + m[n + 1]! * y + m[n + 2]! * z + m[n + 3]!;
    return (at) => {
      const depth = row(12, at);
      if (depth <= 0) return null;
      return [(0.5 + (0.5 * row(0, at)) / depth) * width, (0.5 - (0.5 * row(4, at)) / depth) * height];
    };
  }

  /** What hides a stroke: the planes that are shown, and what stands in the room. */
  function screens(): Screen[] {
    if (!shown) return [];
    const { axes } = shown;
    const flat = AXES.filter((one) => planes[one].getVisibility()).map((one): Screen => {
      const ends = [0, -1].map((end) => AXES.map((axis) => axes[axis].at(end) ?? 0)) as [Vector, Vector];
      const at = axes[one][nearestIndex(cuts[one], axes[one].length)] ?? 0;
      for (const corner of ends) corner[AXES.indexOf(one)] = at;
      return { lower: ends[0], upper: ends[1] };
    });
    return [...flat, ...boxes];
  }

  /** Choose the finest stride that this machine draws smoothly: without a graphics card a frame costs as much as its samples. */
  function pace(): void {
    window3d.render(); // compiles the shaders
    for (stride of STRIDES) {
      volumeMapper.setSampleDistance(stride * voxel_m);
      const began_ms = performance.now();
      window3d.render();
      finish();
      if (performance.now() - began_ms <= SMOOTH_MS) return;
    }
  }

  /** Wait until everything is really drawn: reading one pixel does. */
  function finish(): void {
    const gl = place.querySelector<HTMLCanvasElement>("canvas:not(.strokes)")?.getContext("webgl2");
    gl?.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  }

  /** The room, what moves in it, the words and the scales, on one canvas. */
  function copyTo(paper: CanvasRenderingContext2D, room: CanvasImageSource, legends: Legend[]): void {
    const { canvas } = paper;
    paper.drawImage(room, 0, 0, canvas.width, canvas.height);
    paper.drawImage(sheet, 0, 0, canvas.width, canvas.height);
    const scale = canvas.width / Math.max(1, place.clientWidth);
    marks.write(paper, scale);
    legends.forEach((one, n) => writeLegend(paper, one, n, scale));
  }

  /** A copy of the room: it can be read in the turn in which it is drawn, and no later. */
  function drawnRoom(): HTMLCanvasElement | null {
    const canvas = place.querySelector<HTMLCanvasElement>("canvas:not(.strokes)");
    const copy = document.createElement("canvas");
    if (!canvas) return null;
    [copy.width, copy.height] = [canvas.width, canvas.height];
    window3d.render();
    copy.getContext("2d")?.drawImage(canvas, 0, 0);
    return copy;
  }

  async function picture(legends: Legend[]): Promise<string> {
    const room = drawnRoom();
    if (!room) return "";
    const paper = room.cloneNode() as HTMLCanvasElement;
    copyTo(paper.getContext("2d")!, room, legends);
    return paper.toDataURL("image/png");
  }

  function film(seconds: number, legends: Legend[]): Promise<Blob | null> {
    let room = drawnRoom();
    if (!room || typeof MediaRecorder === "undefined") return Promise.resolve(null);
    const paper = room.cloneNode() as HTMLCanvasElement;
    const recorder = new MediaRecorder(paper.captureStream(25), { mimeType: "video/webm" });
    const parts: Blob[] = [];
    recorder.ondataavailable = (event) => parts.push(event.data);
    const turned = renderer.getActiveCamera().onModified(() => (room = null));
    const copying = window.setInterval(() => {
      room ??= drawnRoom();
      if (room) copyTo(paper.getContext("2d")!, room, legends);
    }, FRAME_MS);
    return new Promise((done) => {
      recorder.onstop = () => {
        clearInterval(copying);
        turned.unsubscribe();
        done(new Blob(parts, { type: "video/webm" }));
      };
      recorder.start();
      setTimeout(() => recorder.stop(), 1000 * seconds);
    });
  }

  function under(x_px: number, y_px: number): Vector | null {
    if (!shown) return null;
    const { width, height } = place.getBoundingClientRect();
    const ratio = width / Math.max(1, height);
    const [near, far] = [0, 1].map((z) =>
      renderer.normalizedDisplayToWorld(x_px / width, 1 - y_px / height, z, ratio),
    ) as [Vector, Vector];
    const { axes } = shown;
    const isWithin = (at: Vector, except: Axis) =>
      AXES.every((one, a) => one === except || (at[a]! >= (axes[one][0] ?? 0) && at[a]! <= (axes[one].at(-1) ?? 0)));
    const hits = AXES.filter((one) => planes[one].getVisibility()).flatMap((one) => {
      const a = AXES.indexOf(one);
      const plane = axes[one][nearestIndex(cuts[one], axes[one].length)] ?? 0;
      const share = (plane - near[a]!) / (far[a]! - near[a]! || 1e-12);
      const at = near.map((start, b) => start + share * (far[b]! - start)) as Vector;
      at[a] = plane;
      return share > 0 && isWithin(at, one) ? [{ at, share }] : [];
    });
    return hits.sort((one, other) => one.share - other.share)[0]?.at ?? null;
  }

  function seen(): number[] {
    const from = renderer.getActiveCamera();
    return [...from.getPosition(), ...from.getFocalPoint(), ...from.getViewUp()];
  }

  function see(from: number[]): void {
    const [px, py, pz, fx, fy, fz, ux, uy, uz] = from;
    if (from.length !== 9 || from.some((part) => !Number.isFinite(part))) return;
    const camera = renderer.getActiveCamera();
    camera.setPosition(px!, py!, pz!);
    camera.setFocalPoint(fx!, fy!, fz!);
    camera.setViewUp(ux!, uy!, uz!);
    renderer.resetCameraClippingRange();
    window3d.render();
    put();
  }

  function close(): void {
    clearTimeout(timer);
    watch.disconnect();
    turning.unsubscribe();
    marks.set([]);
    sheet.remove();
    for (const axis of AXES) grips[axis].remove();
    view.delete();
  }

  const turning = renderer.getActiveCamera().onModified(put);
  return { load, show, look, move, picture, film, under, seen, see, close };
}

type Actor = ReturnType<typeof vtkActor.newInstance>;

interface Mark {
  text: string;
  at: Vector;
  /** A thing's name, an axis' name, or a tick of an axis. */
  kind: "name" | "axis" | "tick";
  /** What an axis' name is the name of: the name is shown where this is, though it may stand beyond the edge. */
  of?: Vector;
}

/** Words over the picture that stay at their places in the room, inside the picture, and not on one another. */
class Marks {
  private kept: { mark: Mark; element: HTMLElement; width: number; height: number }[] = [];
  private places: ([number, number] | null)[] = [];

  /** `seen`: where a place is on the screen; null behind the eye. */
  constructor(
    private readonly place: HTMLElement,
    private readonly seen: () => (at: Vector) => [number, number] | null,
  ) {}

  set(marks: Mark[]): void {
    for (const one of this.kept) one.element.remove();
    const elements = marks.map((mark) => {
      const element = document.createElement("span");
      element.className = `mark ${mark.kind}`;
      element.textContent = mark.text;
      return { mark, element };
    });
    this.place.append(...elements.map((one) => one.element));
    this.kept = elements.map((one) => ({ ...one, width: one.element.offsetWidth, height: one.element.offsetHeight }));
  }

  /** The same words on a picture, `scale` of its pixels to one of the page. */
  write(paper: CanvasRenderingContext2D, scale: number): void {
    paper.font = `${Math.round(13 * scale)}px "DejaVu Sans", sans-serif`;
    [paper.textAlign, paper.textBaseline] = ["center", "middle"];
    this.kept.forEach(({ mark, width, height }, n) => {
      const at = this.places[n];
      if (!at) return;
      const [left, top] = [at[0] * scale, at[1] * scale];
      paper.fillStyle = BEHIND_NAMES;
      if (mark.kind === "name")
        paper.fillRect(left - (width * scale) / 2, top - (height * scale) / 2, width * scale, height * scale);
      paper.fillStyle = INK;
      paper.fillText(mark.text, left, top);
    });
  }

  put(): void {
    const seen = this.seen();
    const [wide, tall] = [this.place.clientWidth, this.place.clientHeight];
    const labels = this.kept.map(({ mark, width, height }) => {
      let [x, y] = seen(mark.at) ?? [NaN, NaN];
      const [of_x, of_y] = (mark.of && seen(mark.of)) ?? [NaN, NaN];
      if (of_x >= 0 && of_x <= wide && of_y >= 0 && of_y <= tall)
        [x, y] = [Math.max(0, Math.min(wide, x)), Math.max(0, Math.min(tall, y))];
      return { x, y, width, height, fixed: mark.kind === "tick" };
    });
    this.places = placed(labels, wide, tall);
    this.kept.forEach(({ element }, n) => {
      const at = this.places[n];
      element.hidden = !at;
      if (at) element.style.transform = `translate(-50%, -50%) translate(${at[0].toFixed(1)}px, ${at[1].toFixed(1)}px)`;
    });
  }
}

const [BAR_PX, THICK_PX, LINE_PX, EDGE_PX] = [160, 10, 34, 12] as const;

/** The n-th scale, in the upper left corner. */
function writeLegend(paper: CanvasRenderingContext2D, { kind, text, ends }: Legend, n: number, scale: number): void {
  const [left, top] = [EDGE_PX * scale, (EDGE_PX + n * LINE_PX) * scale];
  const colours = table(kind);
  for (let part = 0; part < BAR_PX; part++) {
    const at = 3 * Math.floor((256 * part) / BAR_PX);
    paper.fillStyle = `rgb(${colours[at]} ${colours[at + 1]} ${colours[at + 2]})`;
    paper.fillRect(left + part * scale, top, scale + 1, THICK_PX * scale);
  }
  paper.fillStyle = INK;
  paper.font = `${Math.round(12 * scale)}px "DejaVu Sans", sans-serif`;
  [paper.textAlign, paper.textBaseline] = ["left", "top"];
  paper.fillText(`${ends[0]} to ${ends[1]}`, left, top + (THICK_PX + 2) * scale);
  paper.textBaseline = "middle";
  paper.fillText(text, left + (BAR_PX + 8) * scale, top + (THICK_PX / 2) * scale);
}

/** Metres along three edges of the room, which are at its outline as seen from the corner. */
function axisMarks(axes: Grid["axes"]): Mark[] {
  const [x, y, z] = [axes.x, axes.y, axes.z];
  const [left, right, front, back, floor] = [x[0] ?? 0, x.at(-1) ?? 1, y[0] ?? 0, y.at(-1) ?? 1, z[0] ?? 0];
  const off = 0.06 * (right - left);
  const last = (places: number[]) => ((places.at(-1) ?? 1) + (places[0] ?? 0)) / 2;
  const ticks = (places: number[], at: (value: number) => Vector) =>
    ticksOf(places).map((one): Mark => ({ text: one.label, at: at(one.value), kind: "tick" }));
  return [
    { text: "x [m]", at: [last(x), front - 2.6 * off, floor - 2.6 * off], kind: "axis", of: [last(x), front, floor] },
    { text: "y [m]", at: [right + 2.6 * off, last(y), floor - 2.6 * off], kind: "axis", of: [right, last(y), floor] },
    { text: "z [m]", at: [left - 2.8 * off, back + 2.8 * off, last(z)], kind: "axis", of: [left, back, last(z)] },
    ...ticks(x, (value) => [value, front - off, floor - off]),
    ...ticks(y, (value) => [right + off, value, floor - off]),
    ...ticks(z, (value) => [left - off, back + off, value]),
  ];
}

// A camera that stands further away is drawn here before the room, in parts of the room's depth.
const NEAREST = 0.45;

/** The camera, on its way to the room where it stands far away, and how far from the wall it really is. */
function cameraMark(camera: Vector, axes: Grid["axes"]): Mark {
  const away = (axes.y.at(-1) ?? 1) - camera[1];
  const [x, y, z] = standOf(camera, axes);
  const above = 0.12 * ((axes.z.at(-1) ?? 1) - (axes.z[0] ?? 0));
  const text = `camera, ${away.toFixed(away < 10 ? 1 : 0)} m from the wall`;
  return { text, at: [x, y, z + above], kind: "name" };
}

function standOf(camera: Vector, axes: Grid["axes"]): Vector {
  const [front, back] = [axes.y[0] ?? 0, axes.y.at(-1) ?? 1];
  const y = Math.max(camera[1], front - NEAREST * (back - front));
  const middle = (axis: number[]) => ((axis[0] ?? 0) + (axis.at(-1) ?? 1)) / 2;
  const share = (y - back) / (camera[1] - back || 1);
  const along = (axis: number[], at: number) => middle(axis) + share * (at - middle(axis));
  return [along(axes.x, camera[0]), y, along(axes.z, camera[2])];
}

/** Lines from the camera to the corners of the wall that it looks at. */
function sightOf(camera: Vector, axes: Grid["axes"]): Actor {
  const [x0, x1, z0, z1] = [axes.x[0] ?? 0, axes.x.at(-1) ?? 1, axes.z[0] ?? 0, axes.z.at(-1) ?? 1];
  const back = axes.y.at(-1) ?? 1;
  const corners = [x0, x1].flatMap((x) => [z0, z1].map((z) => [x, back, z]));
  const points = [standOf(camera, axes), ...corners].flat();
  const data = vtkPolyData.newInstance();
  const places = vtkPoints.newInstance();
  places.setData(Float32Array.from(points), 3);
  data.setPoints(places);
  data.setLines(vtkCellArray.newInstance({ values: Uint32Array.from([1, 2, 3, 4].flatMap((n) => [2, 0, n])) }));
  const mapper = vtkMapper.newInstance({ scalarVisibility: false });
  mapper.setInputData(data);
  const actor = vtkActor.newInstance();
  actor.setMapper(mapper);
  actor.getProperty().setColor(0.45, 0.5, 0.56);
  actor.getProperty().setOpacity(0.5);
  // What stands before the room makes nobody step back from it.
  actor.setUseBounds(false);
  return actor;
}

const nameOf = (one: Opening): Mark => ({ text: one.label, at: middleOf(one.corners), kind: "name" });
const middleOf = (corners: Vector[]) =>
  [0, 1, 2].map((a) => corners.reduce((sum, corner) => sum + corner[a]! / corners.length, 0)) as Vector;

function openingOf(one: Opening): Actor {
  const data = vtkPolyData.newInstance();
  const points = vtkPoints.newInstance();
  points.setData(Float32Array.from(one.corners.flat()), 3);
  data.setPoints(points);
  data.setPolys(vtkCellArray.newInstance({ values: Uint32Array.from([4, 0, 1, 2, 3]) }));
  data.setLines(vtkCellArray.newInstance({ values: Uint32Array.from([5, 0, 1, 2, 3, 0]) }));
  const mapper = vtkMapper.newInstance({ scalarVisibility: false });
  mapper.setInputData(data);
  const actor = vtkActor.newInstance();
  actor.setMapper(mapper);
  const [r, g, b] = OPENINGS[one.kind];
  actor.getProperty().setColor(r, g, b);
  actor.getProperty().setLighting(false);
  actor.getProperty().setLineWidth(3);
  return actor;
}

const nearestIndex = (share: number, count: number) => Math.round(share * (count - 1));

/** The vertices of one plane across an axis as a surface, coloured at each vertex; a hole where there is no air. */
function planeMapper(values: Numbers, axes: Grid["axes"], axis: Axis, share: number, scale: Scale) {
  const a = AXES.indexOf(axis);
  const [b, c] = [0, 1, 2].filter((other) => other !== a) as [number, number];
  const [, ny = 1, nz = 1] = values.shape;
  const [rows, columns] = [values.shape[b] ?? 1, values.shape[c] ?? 1];
  const at = [0, 0, 0];
  at[a] = nearestIndex(share, values.shape[a] ?? 1);
  const [places, colours] = [new Float32Array(3 * rows * columns), new Float32Array(rows * columns)];
  for (let i = 0; i < rows; i++)
    for (let k = 0; k < columns; k++) {
      [at[b], at[c]] = [i, k];
      const n = i * columns + k;
      places.set([axes.x[at[0]!] ?? 0, axes.y[at[1]!] ?? 0, axes.z[at[2]!] ?? 0], 3 * n);
      colours[n] = values.values[(at[0]! * ny + at[1]!) * nz + at[2]!]!;
    }
  const cells: number[] = [];
  for (let i = 0; i + 1 < rows; i++)
    for (let k = 0; k + 1 < columns; k++) {
      const n = i * columns + k;
      const corners = [n, n + columns, n + columns + 1, n + 1];
      if (!corners.some((one) => Number.isNaN(colours[one]!))) cells.push(4, ...corners);
    }
  const data = vtkPolyData.newInstance();
  const points = vtkPoints.newInstance();
  points.setData(places, 3);
  data.setPoints(points);
  data.setPolys(vtkCellArray.newInstance({ values: Uint32Array.from(cells) }));
  data.getPointData().setScalars(vtkDataArray.newInstance({ name: "field", values: colours }));
  const mapper = vtkMapper.newInstance({ scalarVisibility: true, interpolateScalarsBeforeMapping: true });
  mapper.setLookupTable(colourFunction(scale));
  mapper.setScalarRange(scale.low, scale.high);
  mapper.setInputData(data);
  return mapper;
}

/** The field for volume and isosurface; what is no air has the value that is not seen. */
function imageOf(values: Numbers, axes: Grid["axes"], scale: Scale) {
  const unseen = scale.kind === "signed" ? (scale.low + scale.high) / 2 : scale.low;
  const [nx = 1, ny = 1, nz = 1] = values.shape;
  const image = vtkImageData.newInstance();
  image.setDimensions(nx, ny, nz);
  const step = (axis: number[]) => ((axis.at(-1) ?? 1) - (axis[0] ?? 0)) / Math.max(1, axis.length - 1);
  image.setOrigin([axes.x[0] ?? 0, axes.y[0] ?? 0, axes.z[0] ?? 0]);
  image.setSpacing([step(axes.x), step(axes.y), step(axes.z)]);
  // Ours runs fastest along z, vtk's along x.
  const turned = new Float32Array(values.values.length);
  for (let i = 0; i < nx; i++)
    for (let j = 0; j < ny; j++)
      for (let k = 0; k < nz; k++) {
        const value = values.values[(i * ny + j) * nz + k]!;
        turned[i + nx * (j + ny * k)] = Number.isNaN(value) ? unseen : value;
      }
  image.getPointData().setScalars(vtkDataArray.newInstance({ name: "field", values: turned }));
  return image;
}

function colourFunction(scale: Scale) {
  const colours = vtkColorTransferFunction.newInstance();
  const anchors = stops(scale.kind);
  anchors.forEach(([r, g, b], index) => {
    const at = scale.low + (index / (anchors.length - 1)) * (scale.high - scale.low);
    colours.addRGBPoint(at, r / 255, g / 255, b / 255);
  });
  return colours;
}

function opacityFunction(scale: Scale) {
  const opacity = vtkPiecewiseFunction.newInstance();
  const middle = (scale.low + scale.high) / 2;
  opacity.addPoint(scale.low, scale.kind === "signed" ? 0.3 : 0);
  opacity.addPoint(middle, scale.kind === "signed" ? 0 : 0.04);
  opacity.addPoint(scale.high, 0.35);
  return opacity;
}

function actorOf(port: ReturnType<ReturnType<typeof vtkOutlineFilter.newInstance>["getOutputPort"]>) {
  const mapper = vtkMapper.newInstance({ scalarVisibility: false });
  mapper.setInputConnection(port);
  const actor = vtkActor.newInstance();
  actor.setMapper(mapper);
  return actor;
}

function linesData(lines: Lines) {
  const data = vtkPolyData.newInstance();
  const points = vtkPoints.newInstance();
  points.setData(lines.points, 3);
  data.setPoints(points);
  data.setLines(vtkCellArray.newInstance({ values: lines.cells }));
  data.getPointData().setScalars(vtkDataArray.newInstance({ name: "speed", values: lines.speeds }));
  return data;
}

function linesMapper(data: ReturnType<typeof linesData>, fastest: number) {
  const mapper = vtkMapper.newInstance({ scalarVisibility: true });
  mapper.setLookupTable(colourFunction({ low: 0, high: fastest, kind: "light" }));
  mapper.setScalarRange(0, fastest);
  mapper.setInputData(data);
  return mapper;
}
