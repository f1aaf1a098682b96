// Words over a drawing: kept inside it, and not on one another.

/** A word where it would stand: its middle and its size. `fixed`: there or not at all, like the tick of an axis. */
export interface Label {
  x: number;
  y: number;
  width: number;
  height: number;
  fixed?: boolean;
}

// Between words, in parts of their height; and by how many heights a word gives way, the nearest first.
const GAP = 0.12;
const STEPS = [0, 1, -1, 2, -2, 3, -3, 4, -4];

/**
 * Where the middles of words stand in a drawing, in any unit; null for one that has no place, or that names what is
 * not in the drawing. Words that are named first stay where they are; `solid` is covered where there is no other place.
 */
export function placed(
  labels: readonly Label[],
  width: number,
  height: number,
  solid: readonly Label[] = [],
): ([number, number] | null)[] {
  const kept: Label[] = [];
  const found = new Map<Label, [number, number]>();
  for (const label of [...labels.filter((one) => !one.fixed), ...labels.filter((one) => one.fixed)]) {
    if (!(label.x >= 0 && label.x <= width && label.y >= 0 && label.y <= height)) continue;
    const gap = GAP * label.height;
    const within = (at: number, size: number, whole: number) =>
      Math.max(size / 2 + gap, Math.min(whole - size / 2 - gap, at));
    const wishes = label.fixed
      ? [label].filter(
          (one) => within(one.x, one.width, width) === one.x && within(one.y, one.height, height) === one.y,
        )
      : STEPS.map((step): Label => {
          const y = label.y + step * (label.height + gap);
          return { ...label, x: within(label.x, label.width, width), y: within(y, label.height, height) };
        });
    const isFree = (one: Label, others: readonly Label[]) => !others.some((other) => areTogether(one, other, gap));
    const free = wishes.filter((one) => isFree(one, kept));
    const best = free.find((one) => isFree(one, solid)) ?? free[0];
    if (!best) continue;
    kept.push(best);
    found.set(label, [best.x, best.y]);
  }
  return labels.map((label) => found.get(label) ?? null);
}

const areTogether = (one: Label, other: Label, gap: number) =>
  Math.abs(one.x - other.x) < (one.width + other.width) / 2 + gap &&
  Math.abs(one.y - other.y) < (one.height + other.height) / 2;

let ruler: CanvasRenderingContext2D | null = null;

/** How wide a text is in the page's font, over the font's size. */
export function wide(text: string): number {
  ruler ??= document.createElement("canvas").getContext("2d")!;
  ruler.font = `100px ${getComputedStyle(document.body).fontFamily}`;
  return ruler.measureText(text).width / 100;
}
