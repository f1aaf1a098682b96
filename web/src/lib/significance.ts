/** Standard deviations to each side that hold 95 % of a normal error: `EITHER_WAY` of core/significance.py. */
export const EITHER_WAY = 1.96;
