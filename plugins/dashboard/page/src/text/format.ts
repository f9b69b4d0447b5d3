// Formats numbers, lengths and times for people.

/** Chainage in engineers' notation: 1+240 for 1240 m, with this many decimals. */
export function station(chainage_m: number, decimals = 0): string {
  const scale = 10 ** decimals;
  const units = Math.round(Math.abs(chainage_m) * scale);
  const sign = chainage_m < 0 && units > 0 ? "-" : "";
  const kilometres = Math.floor(units / (1000 * scale));
  const metres = ((units - kilometres * 1000 * scale) / scale).toFixed(decimals);
  return `${sign}${kilometres}+${metres.padStart(decimals > 0 ? 4 + decimals : 3, "0")}`;
}

/** A number with this many decimals and a proper minus; a dash without a value. */
export function figure(value: number | null | undefined, decimals: number): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = value.toFixed(decimals);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
}

/** A duration: 0.4 s, 32 s, 4 min 05 s, 52 min, 2 h 13 min. */
export function span(seconds: number): string {
  if (seconds < 9.95) return `${Math.max(0, seconds).toFixed(1)} s`;
  if (seconds < 99.5) return `${Math.round(seconds)} s`;
  const whole = Math.round(seconds);
  if (whole < 600) return `${Math.floor(whole / 60)} min ${String(whole % 60).padStart(2, "0")} s`;
  const minutes = Math.round(seconds / 60);
  if (minutes < 100) return `${minutes} min`;
  return `${Math.floor(minutes / 60)} h ${String(minutes % 60).padStart(2, "0")} min`;
}

/** Time of the dive as a clock: 12:05, 1:02:05. */
export function clock(seconds: number): string {
  const whole = Math.max(0, Math.floor(seconds));
  const tail = `${String(Math.floor(whole / 60) % 60).padStart(whole >= 3600 ? 2 : 1, "0")}:${String(whole % 60).padStart(2, "0")}`;
  return whole >= 3600 ? `${Math.floor(whole / 3600)}:${tail}` : tail;
}

/** A length with as many decimals as are useful: 0.25 m, 12.3 m, 1,240 m. */
export function metres(value: number): string {
  if (value < 10) return `${value.toFixed(2)} m`;
  if (value < 100) return `${value.toFixed(1)} m`;
  return `${Math.round(value).toLocaleString("en")} m`;
}
