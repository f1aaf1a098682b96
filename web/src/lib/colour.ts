// Colour scales that stay ordered for colour-blind eyes and in grey print, from a few measured stops.

type Stop = readonly [number, number, number];

// Cividis (Nunez et al. 2018), for quantities from low to high.
const CIVIDIS: readonly Stop[] = [
  [0, 34, 78],
  [18, 53, 112],
  [59, 73, 108],
  [87, 93, 109],
  [112, 113, 115],
  [138, 134, 120],
  [165, 156, 116],
  [195, 179, 105],
  [225, 204, 85],
  [254, 232, 56],
];
// Purple to orange through white (ColorBrewer PuOr), for quantities with a sign.
const PUOR: readonly Stop[] = [
  [45, 0, 75],
  [84, 39, 136],
  [128, 115, 172],
  [178, 171, 210],
  [216, 218, 235],
  [247, 247, 247],
  [254, 224, 182],
  [253, 184, 99],
  [224, 130, 20],
  [179, 88, 6],
  [127, 59, 8],
];

// Blue to red through pale yellow (ColorBrewer RdYlBu), for the air's temperature: cold and warm as people think.
const WARM: readonly Stop[] = [
  [49, 54, 149],
  [69, 117, 180],
  [116, 173, 209],
  [171, 217, 233],
  [224, 243, 248],
  [255, 255, 191],
  [254, 224, 144],
  [253, 174, 97],
  [244, 109, 67],
  [215, 48, 39],
  [165, 0, 38],
];

// Light throughout, for lines on a dark ground: blue, green, yellow, orange.
const LIGHT: readonly Stop[] = [
  [102, 178, 255],
  [120, 220, 190],
  [230, 235, 120],
  [255, 190, 80],
  [255, 120, 70],
];
const STOPS = { rising: CIVIDIS, signed: PUOR, warm: WARM, light: LIGHT };

export interface Scale {
  low: number;
  high: number;
  kind: keyof typeof STOPS;
}

/** A scale for values between two bounds: symmetric about zero where the quantity has a sign. */
export function scaleFor(name: string, low: number, high: number): Scale {
  const reach = Math.max(Math.abs(low), Math.abs(high)) || 1;
  if (/^[uvwp](_truth)?$|_error$|_difference$|^T_departure(\.\d+)?$/.test(name))
    return { low: -reach, high: reach, kind: "signed" };
  const kind = /^T(_truth|_burst(\.\d+)?)?$/.test(name) ? "warm" : "rising";
  return { low, high: high > low ? high : low + 1e-6, kind };
}

export function stops(kind: Scale["kind"]): readonly Stop[] {
  return STOPS[kind];
}

/** 256 colours as RGB triples. */
export function table(kind: Scale["kind"]): Uint8ClampedArray {
  const anchors = stops(kind);
  const colours = new Uint8ClampedArray(256 * 3);
  for (let i = 0; i < 256; i++) {
    const at = (i / 255) * (anchors.length - 1);
    const k = Math.min(anchors.length - 2, Math.floor(at));
    const [a, b] = [anchors[k]!, anchors[k + 1]!];
    for (let c = 0; c < 3; c++) colours[3 * i + c] = a[c]! + (at - k) * (b[c]! - a[c]!);
  }
  return colours;
}

/** The same colours as a page's styles write them. */
export function inks(kind: Scale["kind"]): string[] {
  const colours = table(kind);
  return Array.from({ length: 256 }, (_, n) => `rgb(${colours.slice(3 * n, 3 * n + 3).join(" ")})`);
}

/** What is no air: people and furniture. */
export const SOLID: Stop = [128, 130, 134];

/** Paints a plane: the first index to the right, the second upwards. Where there is no air it is grey. */
export function paint(values: Float32Array, shape: number[], scale: Scale): ImageData {
  const [across, up] = [shape[0] ?? 1, shape[1] ?? 1];
  const colours = table(scale.kind);
  const image = new ImageData(across, up);
  const factor = 255 / (scale.high - scale.low);
  for (let i = 0; i < across; i++)
    for (let j = 0; j < up; j++) {
      const value = values[i * up + j]!;
      const level = Math.max(0, Math.min(255, Math.round((value - scale.low) * factor)));
      const colour = Number.isNaN(value) ? SOLID : colours.subarray(3 * level, 3 * level + 3);
      image.data.set([...colour, 255], 4 * ((up - 1 - j) * across + i));
    }
  return image;
}
