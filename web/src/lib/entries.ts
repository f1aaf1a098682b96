// A field of the answers in the words of its form: `supply[1].upper[0]` is "supply 2, y to".
import type { Tree } from "./draft.svelte";

const AXES: Record<string, string> = { x: "yz", y: "xz", z: "xy" };
const ROOM = ["length along x", "depth along y", "height along z"];
const CALLED: Record<string, string> = { title: "name", air: "still air", lower: "from", upper: "to" };

/** The two axes of a wall, in the order in which a rectangle on it is given. */
export const axesOf = (wall: unknown) => AXES[String(wall)[0] ?? "x"] ?? "yz";

/** What a thing's fields stand under. */
export function titleOf(kind: string, index: number, item: Tree | undefined): string {
  if (kind === "view") return String(item?.["name"] || `camera ${index + 2}`);
  if (kind === "light") return String(item?.["name"] || `projector ${index + 2}`);
  return `${kind} ${index + 1}`;
}

/** Where a field is; its parts may also be joined by points. */
export function placeWords(field: string, answers: Tree): string {
  const [kind = "", ...rest] = field.match(/[^.[\]]+/g) ?? [];
  const word = (part: string) => CALLED[part] ?? part.replaceAll("_", " ");
  if (kind === "room") return ["room", ...rest.map((part) => ROOM[Number(part)] ?? part)].join(", ");
  const things = answers[kind];
  if (!Array.isArray(things) || !rest.length) return [kind, ...rest].map(word).join(", ");
  const [index, ...inner] = rest as [string, ...string[]];
  const item = things[Number(index)] as Tree | undefined;
  const said = [titleOf(kind, Number(index), item)];
  inner.forEach((part, n) => {
    const corner = ["lower", "upper"].includes(inner[n - 1] ?? "");
    if (!/^\d+$/.test(part)) said.push(word(part));
    else if (corner) said.push(`${axesOf(item?.["wall"])[Number(part)]} ${said.pop()}`);
    else said.push("xyz"[Number(part)] ?? part);
  });
  return said.join(", ");
}
