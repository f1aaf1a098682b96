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
import { stops, type Scale } from "./colour";
import { arrows, streamlines, type Grid, type Lines } from "./flow";

export interface Modes {
  volume: boolean;
  surface: boolean;
  arrows: boolean;
  streamlines: boolean;
}

export interface Scene3d {
  load(values: Numbers, velocity: Numbers[] | null, axes: Grid["axes"], scale: Scale): void;
  show(modes: Modes, level: number): void;
  picture(): Promise<string>;
  close(): void;
}

// Voxels from sample to sample along a ray, finest first; the first that is fast enough is kept.
const STRIDES = [1.5, 2.2, 3.2] as const;
const SMOOTH_MS = 90;

export function createScene(place: HTMLElement): Scene3d {
  const view = vtkGenericRenderWindow.newInstance({ background: [0.08, 0.09, 0.11], listenWindowResize: false });
  view.setContainer(place as HTMLDivElement);
  const renderer = view.getRenderer();
  const window3d = view.getRenderWindow();
  const watch = new ResizeObserver(() => view.resize());
  watch.observe(place);
  view.resize();

  const volume = vtkVolume.newInstance();
  const volumeMapper = vtkVolumeMapper.newInstance();
  volume.setMapper(volumeMapper);
  const cubes = vtkImageMarchingCubes.newInstance({ computeNormals: true, mergePoints: true });
  const surface = actorOf(cubes.getOutputPort());
  surface.getProperty().setOpacity(0.7);
  const arrowActor = vtkActor.newInstance();
  const lineActor = vtkActor.newInstance();
  for (const actor of [arrowActor, lineActor]) actor.getProperty().setLineWidth(2);
  const outline = vtkOutlineFilter.newInstance();
  const frame = actorOf(outline.getOutputPort());
  frame.getProperty().setColor(0.6, 0.65, 0.7);
  let scale: Scale = { low: 0, high: 1, signed: false };
  let loaded = false;
  let stride = 0;
  let voxel_m = 1;

  function load(values: Numbers, velocity: Numbers[] | null, axes: Grid["axes"], wanted: Scale): void {
    scale = wanted;
    const image = imageOf(values, axes);
    const colours = colourFunction(scale);
    volumeMapper.setInputData(image);
    voxel_m = Math.min(...image.getSpacing());
    volumeMapper.setSampleDistance((stride || STRIDES[0]) * voxel_m);
    volume.getProperty().setRGBTransferFunction(0, colours);
    volume.getProperty().setScalarOpacity(0, opacityFunction(scale));
    volume.getProperty().setInterpolationTypeToLinear();
    cubes.setInputData(image);
    outline.setInputData(image);
    if (velocity) {
      const grid: Grid = { axes, u: velocity[0]!, v: velocity[1]!, w: velocity[2]! };
      arrowActor.setMapper(mapperOf(arrows(grid)));
      lineActor.setMapper(mapperOf(streamlines(grid)));
    }
    renderer.removeAllViewProps();
    renderer.addVolume(volume);
    for (const actor of [surface, arrowActor, lineActor, frame]) if (actor.getMapper()) renderer.addActor(actor);
    if (!loaded) lookFrom(renderer.getActiveCamera(), image.getCenter());
    if (!loaded) renderer.resetCamera();
    if (!loaded) renderer.getActiveCamera().zoom(1.1);
    loaded = true;
  }

  function show(modes: Modes, level: number): void {
    if (!loaded) return;
    volume.setVisibility(modes.volume);
    surface.setVisibility(modes.surface);
    arrowActor.setVisibility(modes.arrows);
    lineActor.setVisibility(modes.streamlines);
    const value = scale.low + level * (scale.high - scale.low);
    if (modes.surface) cubes.setContourValue(value);
    const colour: number[] = [0, 0, 0];
    colourFunction(scale).getColor(value, colour as [number, number, number]);
    surface.getProperty().setColor(colour[0]!, colour[1]!, colour[2]!);
    if (!stride && modes.volume) pace();
    const began_ms = performance.now();
    window3d.render();
    place.dataset["frameMs"] = (performance.now() - began_ms).toFixed(1);
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
    const gl = place.querySelector("canvas")?.getContext("webgl2");
    gl?.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  }

  async function picture(): Promise<string> {
    const [captured] = window3d.captureImages();
    return (await captured) ?? "";
  }

  function close(): void {
    watch.disconnect();
    view.delete();
  }

  return { load, show, picture, close };
}

/** From the front, a little to the left and above; z points upwards. */
function lookFrom(
  camera: ReturnType<
    ReturnType<ReturnType<typeof vtkGenericRenderWindow.newInstance>["getRenderer"]>["getActiveCamera"]
  >,
  centre: number[],
) {
  const [x = 0, y = 0, z = 0] = centre;
  camera.setFocalPoint(x, y, z);
  camera.setPosition(x - 0.55, y - 1, z + 0.45);
  camera.setViewUp(0, 0, 1);
}

function imageOf(values: Numbers, axes: Grid["axes"]) {
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
      for (let k = 0; k < nz; k++) turned[i + nx * (j + ny * k)] = values.values[(i * ny + j) * nz + k]!;
  image.getPointData().setScalars(vtkDataArray.newInstance({ name: "field", values: turned }));
  return image;
}

function colourFunction(scale: Scale) {
  const colours = vtkColorTransferFunction.newInstance();
  const anchors = stops(scale.signed);
  anchors.forEach(([r, g, b], index) => {
    const at = scale.low + (index / (anchors.length - 1)) * (scale.high - scale.low);
    colours.addRGBPoint(at, r / 255, g / 255, b / 255);
  });
  return colours;
}

function opacityFunction(scale: Scale) {
  const opacity = vtkPiecewiseFunction.newInstance();
  const middle = (scale.low + scale.high) / 2;
  opacity.addPoint(scale.low, scale.signed ? 0.3 : 0);
  opacity.addPoint(middle, scale.signed ? 0 : 0.04);
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

function mapperOf(lines: Lines) {
  const data = vtkPolyData.newInstance();
  const points = vtkPoints.newInstance();
  points.setData(lines.points, 3);
  data.setPoints(points);
  data.setLines(vtkCellArray.newInstance({ values: lines.cells }));
  data.getPointData().setScalars(vtkDataArray.newInstance({ name: "speed", values: lines.speeds }));
  const fastest = lines.speeds.reduce((most, one) => Math.max(most, one), 1e-9);
  const mapper = vtkMapper.newInstance({ scalarVisibility: true });
  mapper.setLookupTable(colourFunction({ low: 0, high: fastest, signed: false }));
  mapper.setScalarRange(0, fastest);
  mapper.setInputData(data);
  return mapper;
}
