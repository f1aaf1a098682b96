// Where a projector begins on New and Room: before its own wall, where no other device stands.
import { draft, metres, written, type Tree } from "./draft.svelte";

const HEIGHT_M = 1.3;
// Along the wall, as parts of its width.
const ALONG = [1 / 2, 1 / 4, 3 / 4, 1 / 8, 7 / 8];

/** The axis across a wall, the one along it, the other one; and whether the wall is the upper one. */
function axesOf(wall: string): [number, number, number, boolean] {
  const across = "xyz".indexOf(wall.charAt(0));
  const along = across === 0 ? 1 : 0;
  return [across, along, 3 - across - along, wall.endsWith("max")];
}

const placeOf = (one: Tree) => {
  const place = (one["position"] as unknown[] | undefined)?.map(metres);
  return place?.length === 3 && place.every((value) => value !== null) ? (place as number[]) : null;
};

/** A place as far from the devices of a camera's wall as any, at the distance and height of its projector, else its own. */
export function placeBefore(wall: string, camera: Tree, others: Tree[]): string[] {
  const size = [0, 1, 2].map((axis) => metres((draft.answers["room"] as unknown[] | undefined)?.[axis]) ?? 4);
  const [across, along, other, upper] = axesOf(wall);
  const lens = placeOf(camera);
  const distance_m = metres(camera["distance"]) ?? 0.5 * size[across]!;
  const eye = lens ?? size.map((value) => value / 2);
  if (!lens) eye[across] = upper ? size[across]! - distance_m : distance_m;
  const places = others.map(placeOf).filter((one) => one !== null);
  const beside = places[0] ?? eye;
  const taken = [eye, ...places];
  const nearest = (place: number[]) =>
    Math.min(...taken.map((one) => Math.hypot(...place.map((value, axis) => value - one[axis]!))));
  const candidates = ALONG.map((part) => {
    const place = [...beside];
    place[along] = part * size[along]!;
    if (!places.length && other === 2) place[other] = Math.min(HEIGHT_M, size[other]! / 2);
    return place;
  });
  return candidates.reduce((a, b) => (nearest(b) > nearest(a) + 1e-6 ? b : a)).map(written);
}
