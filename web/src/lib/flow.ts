// Arrows and streamlines from a velocity field on a vertex grid.
import type { Numbers } from "./api";

export interface Grid {
  axes: Record<"x" | "y" | "z", number[]>;
  u: Numbers;
  v: Numbers;
  w: Numbers;
}

/** Poly-lines as vtk wants them: points, cells (count, indices ...), and the speed at each point. */
export interface Lines {
  points: Float32Array;
  cells: Uint32Array;
  speeds: Float32Array;
}

type Vector = [number, number, number];

export function arrows(grid: Grid, each = 9): Lines {
  const segments: Vector[][] = [];
  const speeds: number[] = [];
  const fastest = speedLimit(grid);
  const reach = 0.9 * Math.min(...sizes(grid).map((size) => size / each));
  for (const from of lattice(grid, each)) {
    const velocity = at(grid, from);
    const speed = Math.hypot(...velocity);
    if (speed < 0.01 * fastest) continue;
    const to = step(from, velocity, reach / fastest);
    const side = sideways(velocity, (0.25 * reach * speed) / fastest);
    const neck = step(from, velocity, (0.7 * reach) / fastest);
    segments.push([from, to, add(neck, side, 1), to, add(neck, side, -1)]);
    speeds.push(speed, speed, speed, speed, speed);
  }
  return linesOf(segments, speeds);
}

export function streamlines(grid: Grid, each = 4, steps = 300): Lines {
  const lines: Vector[][] = [];
  const speeds: number[] = [];
  const fastest = speedLimit(grid);
  const length = Math.hypot(...sizes(grid)) / 200;
  for (const seed of lattice(grid, each)) {
    const line: Vector[] = [];
    let here = seed;
    for (let n = 0; n < steps && inside(grid, here); n++) {
      const first = at(grid, here);
      const speed = Math.hypot(...first);
      if (speed < 0.005 * fastest) break;
      line.push(here);
      speeds.push(speed);
      // The midpoint rule, in steps of equal length.
      const middle = at(grid, step(here, first, length / 2 / speed));
      here = step(here, middle, length / Math.max(1e-9, Math.hypot(...middle)));
    }
    if (line.length > 1) lines.push(line);
    else speeds.length -= line.length;
  }
  return linesOf(lines, speeds);
}

function linesOf(lines: Vector[][], speeds: number[]): Lines {
  const cells: number[] = [];
  let first = 0;
  for (const line of lines) {
    cells.push(line.length, ...line.map((_, index) => first + index));
    first += line.length;
  }
  return {
    points: Float32Array.from(lines.flat(2)),
    cells: Uint32Array.from(cells),
    speeds: Float32Array.from(speeds),
  };
}

function lattice(grid: Grid, each: number): Vector[] {
  const [low, size] = [lows(grid), sizes(grid)];
  const found: Vector[] = [];
  for (let i = 0; i < each; i++)
    for (let j = 0; j < each; j++)
      for (let k = 0; k < each; k++)
        found.push([0, 1, 2].map((a) => low[a]! + (([i, j, k][a]! + 0.5) / each) * size[a]!) as Vector);
  return found;
}

/** Velocity at a place, linear between vertices. */
export function at(grid: Grid, where: Vector): Vector {
  const [nx = 1, ny = 1, nz = 1] = grid.u.shape;
  const shape = [nx, ny, nz];
  const [low, size] = [lows(grid), sizes(grid)];
  const place = where.map((x, a) => Math.max(0, Math.min(0.9999, (x - low[a]!) / size[a]!)) * (shape[a]! - 1));
  const cell = place.map(Math.floor);
  const part = place.map((x, a) => x - cell[a]!);
  const sum: Vector = [0, 0, 0];
  for (let corner = 0; corner < 8; corner++) {
    const bits = [corner & 1, (corner >> 1) & 1, corner >> 2];
    const weight = bits.reduce((w, bit, a) => w * (bit ? part[a]! : 1 - part[a]!), 1);
    const index = ((cell[0]! + bits[0]!) * ny + cell[1]! + bits[1]!) * nz + cell[2]! + bits[2]!;
    sum[0] += weight * (grid.u.values[index] ?? 0);
    sum[1] += weight * (grid.v.values[index] ?? 0);
    sum[2] += weight * (grid.w.values[index] ?? 0);
  }
  return sum;
}

const lows = (grid: Grid) => [grid.axes.x[0] ?? 0, grid.axes.y[0] ?? 0, grid.axes.z[0] ?? 0];
const sizes = (grid: Grid) =>
  [grid.axes.x, grid.axes.y, grid.axes.z].map((axis) => (axis.at(-1) ?? 1) - (axis[0] ?? 0) || 1);
const step = (from: Vector, by: Vector, factor: number) => add(from, by, factor);
const add = (a: Vector, b: Vector, factor: number) => a.map((x, i) => x + factor * b[i]!) as Vector;

function inside(grid: Grid, where: Vector): boolean {
  const [low, size] = [lows(grid), sizes(grid)];
  return where.every((x, a) => x >= low[a]! && x <= low[a]! + size[a]!);
}

function sideways(along: Vector, length: number): Vector {
  const up: Vector = Math.abs(along[2]) < 0.9 * Math.hypot(...along) ? [0, 0, 1] : [1, 0, 0];
  const cross: Vector = [
    along[1] * up[2] - along[2] * up[1],
    along[2] * up[0] - along[0] * up[2],
    along[0] * up[1] - along[1] * up[0],
  ];
  const size = Math.hypot(...cross) || 1;
  return cross.map((x) => (x * length) / size) as Vector;
}

/** The largest speed on the grid. */
export function speedLimit(grid: Grid): number {
  let fastest = 1e-9;
  for (let i = 0; i < grid.u.values.length; i++)
    fastest = Math.max(fastest, Math.hypot(grid.u.values[i]!, grid.v.values[i]!, grid.w.values[i]!));
  return fastest;
}
