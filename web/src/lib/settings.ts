import { curveName } from "./words";

// Nested settings as flat lines, so that two results can be told apart line by line.

/** Every leaf by its path: `settings.scene.room.upper_m.0` -> 4. */
export function leaves(value: unknown, path = ""): Record<string, string> {
  if (value === null || typeof value !== "object") return { [path]: JSON.stringify(value) ?? "" };
  const found: Record<string, string> = {};
  for (const [key, inner] of Object.entries(value)) Object.assign(found, leaves(inner, path ? `${path}.${key}` : key));
  return found;
}

export interface Difference {
  path: string;
  left: string;
  right: string;
}

export function differences(left: unknown, right: unknown): Difference[] {
  const [a, b] = [leaves(left), leaves(right)];
  return Object.keys({ ...a, ...b })
    .filter((path) => a[path] !== b[path])
    .map((path) => ({ path, left: a[path] ?? "–", right: b[path] ?? "–" }));
}

/** Rows recorded by two solves as columns over the union of their steps. */
export function together(histories: Record<string, Record<string, number | null>[]>) {
  const stepOf = (row: Record<string, number | null>, index: number) => row["step"] ?? row["iteration"] ?? index + 1;
  const skipped = ["step", "steps", "iteration", "elapsed_s"];
  const step = [...new Set(Object.values(histories).flatMap((rows) => rows.map(stepOf)))].sort((a, b) => a - b);
  const at = new Map(step.map((value, index) => [value, index]));
  const values: Record<string, (number | null)[]> = {};
  for (const [label, rows] of Object.entries(histories))
    rows.forEach((row, index) => {
      for (const [name, value] of Object.entries(row)) {
        if (skipped.includes(name)) continue;
        const line = (values[`${curveName(name)}, ${label}`] ??= step.map(() => null));
        line[at.get(stepOf(row, index))!] = value;
      }
    });
  return { step, values };
}
