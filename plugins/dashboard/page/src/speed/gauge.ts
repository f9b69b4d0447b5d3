// Positions on the speed gauge, as pure functions that tests can call.

/** Ratio of speed to v_max above which the speed counts as too fast, as in the loop's conditions. */
export const TOO_FAST = 1.05;

/** End of the scale, m/s. It leaves v_max at about two thirds of the scale, and includes the speed. */
export function scaleEnd(speed_mps: number | null, v_max_mps: number | null): number {
  const need = Math.max((v_max_mps ?? 0) * 1.5, Math.abs(speed_mps ?? 0) * 1.1, 0.1);
  const steps = [0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1, 1.5, 2, 3, 5];
  return steps.find((step) => step >= need - 1e-9) ?? Math.ceil(need);
}

/** Marks on a scale. */
export function marks(end: number): number[] {
  const step = end <= 0.2 ? 0.05 : end <= 0.6 ? 0.1 : end <= 1 ? 0.2 : end <= 2 ? 0.5 : 1;
  return Array.from({ length: Math.floor(end / step + 1e-9) + 1 }, (_, n) => n * step);
}
