// Samples near the visible part of the wall: fetched for a window of chainage, then extended by live samples.
import { SAMPLE_BYTES, type Frame } from "../feed/binary";
import { downOf, type Round } from "./view";

/** Floats per sample: x from the origin, fraction of the perimeter from the crown, time, and head + 16 * outcome. A
 * sample near the seam has a copy with a fraction outside 0 to 1. */
export const FLOATS = 4;
/** A live frame with more records than this may have been thinned, because the server sends at most 1,000 at once. */
const WHOLE_LIVE = 500;
/** Minimum interval between requests for all samples, after live frames that may have been thinned. */
const AGAIN_MS = 2000;
const CAPACITY = 260_000;
const MARGIN = 0.2;

export class SampleWindow {
  from_m = NaN;
  to_m = NaN;
  origin_m = 0;
  count = 0;
  /** Whether only some of the samples are loaded, so that missed sections can't be judged from them. */
  thinned = false;
  private stale = false;
  private asked_ms = -Infinity;
  round: Round = { crown: 0, sign: 1 };
  /** Distance from the seam, as a share of the perimeter, within which a disc extends across the seam. */
  seam = 0;
  readonly data = new Float32Array(CAPACITY * FLOATS);
  /** Number of samples already uploaded to the graphics processor. */
  uploaded = 0;
  private asked: AbortController | null = null;
  private askedFrom_m = NaN;
  private askedTo_m = NaN;

  constructor(
    private readonly fetch: (from_m: number, to_m: number, signal: AbortSignal) => Promise<{ frame: Frame; oneOf: number }>,
    private readonly changed: () => void,
  ) {}

  clear(): void {
    this.asked?.abort();
    this.asked = null;
    this.from_m = this.to_m = this.askedFrom_m = this.askedTo_m = NaN;
    this.count = this.uploaded = 0;
    this.thinned = this.stale = false;
  }

  covers(from_m: number, to_m: number): boolean {
    return !this.thinned && !this.stale && from_m >= this.from_m && to_m <= this.to_m;
  }

  /** Loads the samples between two chainages. `way` is the range of chainages that has samples. */
  want(from_m: number, to_m: number, way: [number, number]): void {
    const from = Math.max(from_m, way[0]), to = Math.min(to_m, way[1]);
    if (!(to > from) || this.covers(from, to)) return;
    if (this.thinned && from_m >= this.from_m && to_m <= this.to_m && to_m - from_m > (this.to_m - this.from_m) * 0.4) return;
    if (this.asked && from >= this.askedFrom_m && to <= this.askedTo_m) return;
    if (this.stale && performance.now() - this.asked_ms < AGAIN_MS) return;
    this.asked_ms = performance.now();
    const margin = (to_m - from_m) * MARGIN;
    const wantFrom = from_m - margin, wantTo = to_m + margin;
    this.asked?.abort();
    const asked = new AbortController();
    this.asked = asked;
    this.askedFrom_m = wantFrom;
    this.askedTo_m = wantTo;
    this.fetch(wantFrom, wantTo, asked.signal).then(
      ({ frame, oneOf }) => {
        if (this.asked !== asked) return;
        this.asked = null;
        this.stale = false;
        this.thinned = oneOf > 1;
        this.fill(frame, wantFrom, wantTo, way);
        this.changed();
      },
      () => {
        // Without an answer, columns are drawn instead. The request is repeated when the view or the wall changes.
        if (this.asked === asked) this.asked = null;
      },
    );
  }

  private fill(frame: Frame, from_m: number, to_m: number, way: [number, number]): void {
    this.origin_m = Math.round((from_m + to_m) / 2);
    // Beyond the ends of the coverage extent, all samples are live ones, so the window is open-ended there.
    this.from_m = from_m <= way[0] ? -Infinity : from_m;
    this.to_m = to_m >= way[1] ? Infinity : to_m;
    this.count = this.uploaded = 0;
    this.add(frame);
  }

  /** Adds live samples within the window. */
  take(frame: Frame): void {
    if (Number.isNaN(this.from_m)) return;
    if (frame.count > WHOLE_LIVE) this.stale = true;
    this.add(frame);
  }

  private put(x: number, down: number, t_s: number, kind: number): void {
    if (this.count >= CAPACITY) return;
    this.data.set([x, down, t_s, kind], this.count * FLOATS);
    this.count += 1;
  }

  private add(frame: Frame): void {
    const { view, count } = frame;
    if (this.count + count > CAPACITY) {
      this.clear();
      return;
    }
    for (let at = 0; at < count * SAMPLE_BYTES; at += SAMPLE_BYTES) {
      const x = view.getFloat32(at + 4, true);
      if (!(x >= this.from_m && x <= this.to_m)) continue;
      const down = downOf(this.round, view.getUint16(at + 16, true) / 65536);
      const t_s = view.getUint32(at, true) / 1000;
      const kind = Math.min(view.getUint8(at + 18), 15) + 16 * view.getUint8(at + 19);
      this.put(x - this.origin_m, down, t_s, kind);
      if (down < this.seam) this.put(x - this.origin_m, down + 1, t_s, kind);
      else if (down > 1 - this.seam) this.put(x - this.origin_m, down - 1, t_s, kind);
    }
  }
}
