// Formats numbers, lengths and times for people.

/** Chainage in engineers' notation: 1+240.0 for 1240 m, with this many decimals. */
export function station(chainage_m: number, decimals = 1): string {
  const scale = 10 ** decimals;
  const units = Math.round(Math.abs(chainage_m) * scale);
  const sign = chainage_m < 0 && units > 0 ? "-" : "";
  const kilometres = Math.floor(units / (1000 * scale));
  const metres = ((units - kilometres * 1000 * scale) / scale).toFixed(decimals);
  return `${sign}${kilometres}+${metres.padStart(4 + decimals, "0")}`;
}

/** A stretch with one decimal, rounded outward, in the given order: 0+016.3–0+010.7 for 16.25 to 10.75 m. */
export function stretch(from_m: number, to_m: number): string {
  const end = (at_m: number, other_m: number): string => station((at_m > other_m ? Math.ceil(at_m * 10 - 1e-6) : Math.floor(at_m * 10 + 1e-6)) / 10);
  return `${end(from_m, to_m)}–${end(to_m, from_m)}`;
}

/** A speed that may not be exceeded, rounded down to hundredths, and below 0.1 m/s to thousandths. */
export function speedDown(speed_mps: number): string {
  const decimals = speed_mps < 0.1 ? 3 : 2, scale = 10 ** decimals;
  return figure(Math.floor(speed_mps * scale + 1e-6) / scale, decimals);
}

/** Direction of the nose from the tunnel axis: 1.2° left. Positive yaw is to the left. */
export function heading(yaw_deg: number): string {
  const size = figure(Math.abs(yaw_deg), 1);
  return size === "0.0" ? "0.0°" : `${size}° ${yaw_deg > 0 ? "left" : "right"}`;
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
