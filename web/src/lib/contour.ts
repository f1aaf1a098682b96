// Lines of equal values on a plane of vertices.
import type { Scale } from "./colour";

type Point = [number, number];
const LINES = 7;

/** Round values between the ends of a scale, one a line. */
export function levelsOf(scale: Scale): number[] {
  const rough = (scale.high - scale.low) / LINES;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((one) => one * power).find((one) => one >= rough) ?? rough;
  const first = Math.ceil(scale.low / step + 1e-9);
  const count = Math.max(0, Math.ceil(scale.high / step - 1e-9) - first);
  return Array.from({ length: count }, (_, n) => (first + n) * step);
}

/** The line of one value as short pieces, in shares of the plane; the first index to the right, the second upwards. */
export function contour(values: ArrayLike<number>, shape: number[], level: number): [Point, Point][] {
  const [across, up] = [shape[0] ?? 1, shape[1] ?? 1];
  const pieces: [Point, Point][] = [];
  for (let i = 0; i + 1 < across; i++)
    for (let j = 0; j + 1 < up; j++) {
      // Round the cell: where two neighbouring corners lie on either side, the line crosses the edge between them.
      const corners: [number, number, number][] = [
        [i, j, values[i * up + j]!],
        [i + 1, j, values[(i + 1) * up + j]!],
        [i + 1, j + 1, values[(i + 1) * up + j + 1]!],
        [i, j + 1, values[i * up + j + 1]!],
      ];
      const crossed: Point[] = [];
      corners.forEach(([x, y, value], n) => {
        const [nextX, nextY, next] = corners[(n + 1) % 4]!;
        // No line runs where there is no air.
        if (Number.isNaN(value + next) || value < level === next < level) return;
        const part = (level - value) / (next - value);
        crossed.push([(x + part * (nextX - x)) / (across - 1), (y + part * (nextY - y)) / (up - 1)]);
      });
      for (let n = 0; n + 1 < crossed.length; n += 2) pieces.push([crossed[n]!, crossed[n + 1]!]);
    }
  return pieces;
}
