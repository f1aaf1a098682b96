/** Round numbers along an axis, each with its share of the way. */
export function ticksOf(places: number[], most = 4): { label: string; value: number; share: number }[] {
  const low = places[0] ?? 0;
  const length = (places.at(-1) ?? 1) - low || 1;
  const rough = length / most;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((one) => one * power).find((one) => one >= rough) ?? rough;
  const first = Math.ceil(low / step - 1e-9);
  const count = Math.floor((low + length) / step + 1e-9) - first + 1;
  return Array.from({ length: count }, (_, n) => {
    const value = Number(((first + n) * step).toPrecision(6));
    return { label: String(value), value, share: (value - low) / length };
  });
}
