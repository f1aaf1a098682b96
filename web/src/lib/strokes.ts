// What moves in the room: strokes along streamlines, drawn on a sheet of their own over the picture of the room, so
// that the room itself is drawn anew only when somebody turns or changes it.
import { inks } from "./colour";
import type { Lines } from "./flow";
import type { Vector } from "./room";

/** What hides what is behind it: boxes; a plane is a flat one. */
export interface Screen {
  lower: Vector;
  upper: Vector;
}

export interface Eye {
  at: Vector;
  /** Null behind the eye. */
  onScreen(at: Vector): [number, number] | null;
}

interface Path {
  points: Vector[];
  times_s: number[];
  speeds: number[];
  phase_s: number;
}

/** Parts of a stroke, from its faint tail to its head. */
const PARTS = 6;
const WIDTH_PX = 3;

/** Strokes that move along lines as fast as the air does; each begins anew at its line's end. */
export class Strokes {
  private readonly paths: Path[] = [];
  private readonly colours = inks("light");

  /** `tail_s`: how long a stroke is, in the time that the air takes along it; `fastest`: the scale's upper end [m/s]. */
  constructor(
    lines: Lines,
    private readonly tail_s: number,
    private readonly fastest: number,
  ) {
    const { cells, points, speeds } = lines;
    for (let c = 0; c < cells.length; c += cells[c]! + 1) {
      const [first, count] = [cells[c + 1]!, cells[c]!];
      const path: Path = { points: [], times_s: [], speeds: [], phase_s: 0 };
      for (let n = first; n < first + count; n++) {
        const here: Vector = [points[3 * n]!, points[3 * n + 1]!, points[3 * n + 2]!];
        const before = path.points.at(-1);
        const length = before ? Math.hypot(here[0] - before[0], here[1] - before[1], here[2] - before[2]) : 0;
        path.times_s.push((path.times_s.at(-1) ?? 0) + length / Math.max(1e-6, speeds[n]!));
        path.points.push(here);
        path.speeds.push(speeds[n]!);
      }
      // Spread over the line by a fixed irregular amount, so that they do not all begin together.
      path.phase_s = ((this.paths.length * 0.618) % 1) * path.times_s.at(-1)!;
      this.paths.push(path);
    }
  }

  /** Draws every stroke where it is at a time; what a screen hides is left out. */
  draw(sheet: CanvasRenderingContext2D, now_s: number, eye: Eye, screens: Screen[]): void {
    sheet.lineWidth = WIDTH_PX;
    sheet.lineCap = "round";
    for (const path of this.paths) {
      const whole_s = path.times_s.at(-1)!;
      const head_s = whole_s > 0 ? (now_s + path.phase_s) % whole_s : 0;
      const tail_s = Math.max(0, head_s - this.tail_s);
      let before: [number, number] | null = null;
      for (let part = 0; part <= PARTS; part++) {
        const { at, speed } = placeOf(path, tail_s + (part / PARTS) * (head_s - tail_s));
        const here = screens.some((one) => isBehind(at, eye.at, one)) ? null : eye.onScreen(at);
        if (before && here) {
          sheet.strokeStyle = this.colours[Math.min(255, Math.round((255 * speed) / this.fastest))]!;
          sheet.globalAlpha = part / PARTS;
          sheet.beginPath();
          sheet.moveTo(...before);
          sheet.lineTo(...here);
          sheet.stroke();
        }
        before = here;
      }
    }
    sheet.globalAlpha = 1;
  }
}

function placeOf({ points, times_s, speeds }: Path, time_s: number): { at: Vector; speed: number } {
  let [low, high] = [0, times_s.length - 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times_s[middle]! <= time_s) low = middle;
    else high = middle;
  }
  const part = (time_s - times_s[low]!) / Math.max(1e-9, times_s[high]! - times_s[low]!);
  const at = points[low]!.map((value, axis) => value * (1 - part) + points[high]![axis]! * part) as Vector;
  return { at, speed: speeds[low]! };
}

/** Whether the way from the eye to a place goes through a box before it ends there. */
function isBehind(at: Vector, eye: Vector, { lower, upper }: Screen): boolean {
  let [enters, leaves] = [0, 1 - 1e-6];
  for (let axis = 0; axis < 3; axis++) {
    const way = at[axis]! - eye[axis]! || 1e-12;
    const ends = [(lower[axis]! - eye[axis]!) / way, (upper[axis]! - eye[axis]!) / way] as const;
    enters = Math.max(enters, Math.min(...ends));
    leaves = Math.min(leaves, Math.max(...ends));
  }
  return enters <= leaves;
}
