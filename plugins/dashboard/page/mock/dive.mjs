// A mock dive in the feed's format: a horseshoe of 3 m radius, four heads in phase shift, missed and undecided stretches.

export const TARGET_M = 0.5, SECTION_M = 0.25, RADIUS_M = 3, HEADS = 4, TURN_S = 4, PINGS = 72;
export const CAUSES = ["too_fast", "angular_step", "missing_returns", "out_of_range", "occluded", "off_axis", "phase",
  "head_stalled", "head_silent", "position_lost", "not_passed", "unknown"];
export const WHYS = ["not_inspected", "position", "several_stretches", "doubtful_returns", "distrusted_head",
  "contradicted_profile", "other_size", "no_wall"];

/** Horseshoe: half a circle above 3 m, straight walls, flat floor; from the floor's centre by the left wall. */
function profileAt(arc) {
  const R = RADIUS_M, pieces = [[R, (s) => [s, 0]], [R, (s) => [R, s]], [Math.PI * R, (s) => {
    const angle = s / R;
    return [R * Math.cos(angle), R + R * Math.sin(angle)];
  }], [R, (s) => [-R, R - s]], [R, (s) => [-R + s, 0]]];
  let left = arc;
  for (const [length, place] of pieces) {
    if (left <= length) return place(left);
    left -= length;
  }
  return [0, 0];
}
export const PERIMETER_M = 4 * RADIUS_M + Math.PI * RADIUS_M;
export const PROFILE = Array.from({ length: 120 }, (_, k) => profileAt((k / 120) * PERIMETER_M));

/** Arc length at which the ray from the reference point (0, R) at a head angle (0 down, growing to the left) meets the wall. */
export function arcAt(angle) {
  const R = RADIUS_M, a = ((angle % (2 * Math.PI)) + 2 * Math.PI) % (2 * Math.PI);
  const y = Math.sin(a), z = -Math.cos(a);
  if (z >= 0) return 2 * R + R * Math.atan2(z, y);
  if (Math.abs(y) <= -z) return (PERIMETER_M + (R * y) / -z) % PERIMETER_M;
  return y > 0 ? R + R + (R * z) / y : 2 * R + Math.PI * R + (R * -z) / -y;
}
export const CLOCK_ARC_M = Array.from({ length: 12 }, (_, hour) => arcAt((hour / 12) * 2 * Math.PI + Math.PI));

/** Uniform noise in 0..1 by number. */
export function noise(n) {
  const x = Math.sin(n * 12.9898 + 4.1) * 43758.5453;
  return x - Math.floor(x);
}

/** Special stretches of the dive: every 137 m one was missed, and every 411 m one is undecided. */
export function kindAt(x_m) {
  const missed = x_m % 137, unsure = (x_m + 60) % 411;
  if (missed > 12 && missed < 18.25) return "fast";
  if (unsure > 30 && unsure < 44) return "unsure";
  return "";
}

/** A section's record for a vehicle at `at_m` that moves inwards. */
export function sectionRecord(view, at, index, at_m, isCleared) {
  const x = (index + 0.5) * SECTION_M, kind = kindAt(x), behind = at_m - x;
  const missed = kind === "fast" && !isCleared;
  const hole = missed ? 0.62 + 0.5 * noise(index) : kind === "unsure" ? 0.46 + 0.06 * noise(index) : 0.26 + 0.2 * noise(index / 9);
  let verdict = missed ? 2 : kind === "unsure" ? 3 : 1;
  let low = 0xffffffff, high = 0xffffffff;
  if (index < 4) { verdict = 4; low = 0x0ff00ff0; high = 0x00ff0000; }
  if (behind < 0.8) {
    verdict = 0;
    const share = Math.max(0, (behind + 0.8) / 1.6);
    low = high = 0;
    for (let bit = 0; bit < 64; bit += 1) {
      if (noise(index * 64 + bit) >= share) continue;
      if (bit < 32) low = (low | (1 << bit)) >>> 0; else high = (high | (1 << (bit - 32))) >>> 0;
    }
  } else if (missed) {
    for (let bit = 0; bit < 32; bit += 1) if (noise(index * 31 + bit) < 0.3) low = (low & ~(1 << bit)) >>> 0;
  }
  view.setInt32(at, index, true);
  view.setUint8(at + 4, verdict);
  view.setUint8(at + 5, missed && verdict === 2 ? 0 : 255);
  view.setUint8(at + 6, verdict === 3 ? 1 : verdict === 4 ? 0 : 255);
  view.setUint8(at + 7, (missed && verdict === 2 ? 1 : 0) | (verdict === 1 ? 2 : 0));
  view.setFloat32(at + 8, verdict === 0 && low === 0 ? NaN : hole, true);
  view.setFloat32(at + 12, 0.02, true);
  view.setFloat32(at + 16, x, true);
  view.setFloat32(at + 20, noise(index + 7) * PERIMETER_M, true);
  view.setUint32(at + 24, low, true);
  view.setUint32(at + 28, high, true);
}

export function frame(kind, records, bytes, write, seq = 0) {
  const out = new DataView(new ArrayBuffer(16 + records * bytes));
  out.setUint8(0, kind);
  out.setUint8(1, 1);
  out.setUint32(4, records, true);
  out.setUint32(8, seq >>> 0, true);
  out.setUint32(12, Math.floor(seq / 2 ** 32), true);
  for (let n = 0; n < records; n += 1) write(out, 16 + n * bytes, n);
  return Buffer.from(out.buffer);
}

export function sectionsFrame(from, to, at_m, seq, cleared = () => false) {
  return frame(1, to - from, 32, (view, at, n) => sectionRecord(view, at, from + n, at_m, cleared(from + n)), seq);
}

/** Pings of the active heads in a time span of a trajectory x(t). */
export function pings(from_s, to_s, xOf, heads) {
  const step_s = TURN_S / PINGS, out = [];
  for (let n = Math.ceil(from_s / step_s); n * step_s < to_s; n += 1) {
    for (const head of heads) {
      const t_s = n * step_s, angle = (n / PINGS + head / HEADS) * 2 * Math.PI;
      const seed = n * HEADS + head, outcome = noise(seed) < 0.01 ? 2 : noise(seed + 0.5) < 0.01 ? 1 : 0;
      const arc = arcAt(angle), [y, z] = profileAt(arc), off = outcome === 1 ? 0.7 : 1 + 0.01 * (noise(seed * 3) - 0.5);
      out.push({ t_s, x_m: xOf(t_s), y_m: y * off, z_m: RADIUS_M + (z - RADIUS_M) * off, arc: arc / PERIMETER_M, head, outcome });
    }
  }
  return out;
}

export function samplesFrame(list, seq = 0) {
  return frame(2, list.length, 20, (view, at, n) => {
    const sample = list[n];
    view.setUint32(at, Math.max(0, Math.round(sample.t_s * 1000)), true);
    view.setFloat32(at + 4, sample.x_m, true);
    view.setFloat32(at + 8, sample.outcome === 2 ? NaN : sample.y_m, true);
    view.setFloat32(at + 12, sample.outcome === 2 ? NaN : sample.z_m, true);
    view.setUint16(at + 16, Math.floor(sample.arc * 65536) & 0xffff, true);
    view.setUint8(at + 18, sample.head);
    view.setUint8(at + 19, sample.outcome);
  }, seq);
}

/** Samples between two chainages of the trajectory so far: 0.2 m/s, and 0.6 m/s where it was too fast. */
export function samplesBetween(from_m, to_m, most = 200_000) {
  const list = [];
  for (let metre = Math.floor(from_m); metre < to_m; metre += 1) {
    const speed = kindAt(metre + 0.5) === "fast" ? 0.6 : 0.2;
    const t0 = metre / 0.2;
    for (const ping of pings(t0, t0 + 1 / speed, (t) => metre + (t - t0) * speed, [0, 1, 2, 3])) {
      if (ping.x_m >= from_m && ping.x_m < to_m) list.push(ping);
    }
  }
  const nth = Math.ceil(list.length / most);
  return nth > 1 ? list.filter((_, n) => n % nth === 0) : list;
}
