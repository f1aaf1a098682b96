// What stands in a room, read from its scene: openings, heaters and the faces of objects as rectangles.

export type Vector = [number, number, number];

export interface Opening {
  kind: "inlet" | "outlet" | "heater" | "object";
  corners: Vector[];
  label: string;
}

interface Part {
  kind: string;
  patch?: { wall: string; lower_m: number[]; upper_m: number[] } | null;
}
interface Scene {
  room: { lower_m: number[]; upper_m: number[] };
  boundary?: Part[];
  objects?: Thing[];
}
interface Thing {
  name: string;
  lower_m: number[];
  upper_m: number[];
}

const NAMES = { inlet: "supply", outlet: "outlet", heater: "heater" } as const;
const isNamed = (kind: string): kind is keyof typeof NAMES => kind in NAMES;

/** The openings and objects that the settings of an experiment name; none where there is no scene. */
export function openingsOf(settings: unknown): Opening[] {
  const scene = (settings as { scene?: Scene } | undefined)?.scene;
  if (!scene) return [];
  const parts = (scene.boundary ?? []).filter((one) => one.patch && isNamed(one.kind));
  const openings = parts.map((one): Opening => {
    const kind = one.kind as keyof typeof NAMES;
    const alike = parts.filter((other) => other.kind === kind);
    const number = alike.length > 1 ? ` ${alike.indexOf(one) + 1}` : "";
    return { kind, label: `${NAMES[kind]}${number}`, corners: cornersOf(one.patch!, scene.room) };
  });
  return [...openings, ...(scene.objects ?? []).flatMap(facesOf)];
}

/** The six faces of a box; its name is on the top. */
export function facesOf(thing: Thing): Opening[] {
  return ["z_max", "z_min", "x_min", "x_max", "y_min", "y_max"].map((wall): Opening => {
    const across = "xyz".indexOf(wall[0]!);
    const without = (corner: number[]) => corner.filter((_, axis) => axis !== across);
    const patch = { wall, lower_m: without(thing.lower_m), upper_m: without(thing.upper_m) };
    return { kind: "object", label: wall === "z_max" ? thing.name : "", corners: cornersOf(patch, thing) };
  });
}

/** The boxes of objects, each from its six faces. */
export function boxesOf(openings: Opening[]): { lower: Vector; upper: Vector }[] {
  const tops = openings.flatMap((one, n) => (one.kind === "object" && one.label ? [n] : []));
  return tops.map((first) => {
    const corners = openings.slice(first, first + 6).flatMap((face) => face.corners);
    const reach = (most: (...values: number[]) => number) =>
      [0, 1, 2].map((axis) => most(...corners.map((corner) => corner[axis]!))) as Vector;
    return { lower: reach(Math.min), upper: reach(Math.max) };
  });
}

/** Where the camera of the first view stands; none where there is no scene. */
export function cameraOf(settings: unknown): Vector | null {
  const scene = (settings as { scene?: { views?: { camera?: { position_m?: number[] } }[] } } | undefined)?.scene;
  const at = scene?.views?.[0]?.camera?.position_m;
  return at?.length === 3 ? (at as Vector) : null;
}

/** The four corners of a rectangle on a wall; its bounds go along the wall's two axes in the order x, y, z. */
function cornersOf(patch: NonNullable<Part["patch"]>, room: Scene["room"]): Vector[] {
  const across = "xyz".indexOf(patch.wall[0] ?? "x");
  const side = patch.wall.endsWith("max") ? room.upper_m : room.lower_m;
  const [low, high] = [patch.lower_m, patch.upper_m];
  return [low, [high[0]!, low[1]!], high, [low[0]!, high[1]!]].map((corner) => {
    const place = [...corner];
    place.splice(across, 0, side[across] ?? 0);
    return place as Vector;
  });
}
