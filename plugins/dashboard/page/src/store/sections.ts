// The wall's sections by index, in arrays that grow in both directions.
import { SECTION_BYTES, type Frame } from "../feed/binary";

export const OPEN = 0, PASS = 1, FAIL = 2, CANNOT_SAY = 3, NOT_INSPECTED = 4;
export const NONE = 255;
export const FLAGGED = 1;
/** Target that a verdict refers to: the dive's own target, or the second target of a comparison. */
export type Held = "own" | "compared";

export class Sections {
  /** Index of the first slot. */
  private base = 0;
  private slots = 0;
  /** Least and greatest index received; least > most if there is none. */
  least = Infinity;
  most = -Infinity;
  /** Verdict of each slot; 255 if nothing has been received for it. */
  verdict = new Uint8Array(0);
  cause = new Uint8Array(0);
  why = new Uint8Array(0);
  flags = new Uint8Array(0);
  hole = new Float32Array(0);
  holeSd = new Float32Array(0);
  holeX = new Float32Array(0);
  holeArc = new Float32Array(0);
  seenLow = new Uint32Array(0);
  seenHigh = new Uint32Array(0);

  clear(): void {
    this.slots = 0;
    this.least = Infinity;
    this.most = -Infinity;
    this.resize(0, 0);
  }

  /** Slot of a section's index, or -1 if nothing has been received for it. */
  slot(index: number): number {
    const slot = index - this.base;
    return slot >= 0 && slot < this.slots && this.verdict[slot] !== NONE ? slot : -1;
  }

  /** Verdict of a slot. */
  verdictOf(slot: number, held: Held): number {
    return held === "own" ? (this.verdict[slot] ?? OPEN) : Math.max(((this.flags[slot] ?? 0) >> 2) - 1, OPEN);
  }

  /** Whether a slot is outlined as a missed section. */
  isFlagged(slot: number, held: Held): boolean {
    return held === "own" ? ((this.flags[slot] ?? 0) & FLAGGED) !== 0 : this.verdictOf(slot, held) === FAIL;
  }

  take(frame: Frame): void {
    const { view, count } = frame;
    if (count === 0) return;
    let least = Infinity, most = -Infinity;
    for (let at = 0; at < count * SECTION_BYTES; at += SECTION_BYTES) {
      const index = view.getInt32(at, true);
      if (index < least) least = index;
      if (index > most) most = index;
    }
    // 4,000,000 sections of 0.05 m are 200 km. A frame that spans more is invalid and would exhaust the memory.
    if (most - least > 4_000_000) throw new Error(`sections from ${least} to ${most} in one frame`);
    this.reach(least, most);
    for (let at = 0; at < count * SECTION_BYTES; at += SECTION_BYTES) {
      const slot = view.getInt32(at, true) - this.base;
      this.verdict[slot] = view.getUint8(at + 4);
      this.cause[slot] = view.getUint8(at + 5);
      this.why[slot] = view.getUint8(at + 6);
      this.flags[slot] = view.getUint8(at + 7);
      this.hole[slot] = view.getFloat32(at + 8, true);
      this.holeSd[slot] = view.getFloat32(at + 12, true);
      this.holeX[slot] = view.getFloat32(at + 16, true);
      this.holeArc[slot] = view.getFloat32(at + 20, true);
      this.seenLow[slot] = view.getUint32(at + 24, true);
      this.seenHigh[slot] = view.getUint32(at + 28, true);
    }
    this.least = Math.min(this.least, least);
    this.most = Math.max(this.most, most);
  }

  private reach(least: number, most: number): void {
    const from = this.slots === 0 ? least : Math.min(least, this.base);
    const to = this.slots === 0 ? most : Math.max(most, this.base + this.slots - 1);
    if (this.slots > 0 && from === this.base && to === this.base + this.slots - 1) return;
    const spare = Math.max(1024, (to - from) >> 1);
    const base = from < this.base || this.slots === 0 ? from - (this.slots === 0 ? 64 : spare) : this.base;
    const end = to >= this.base + this.slots ? to + spare : this.base + this.slots - 1;
    this.resize(base, end - base + 1);
  }

  private resize(base: number, slots: number): void {
    const offset = this.base - base;
    const keep = this.slots;
    const moved = <A extends Uint8Array | Uint32Array | Float32Array>(into: A, old: A): A => {
      if (keep > 0) into.set(old, offset);
      return into;
    };
    const verdict = new Uint8Array(slots).fill(NONE);
    this.verdict = moved(verdict, this.verdict);
    this.cause = moved(new Uint8Array(slots), this.cause);
    this.why = moved(new Uint8Array(slots), this.why);
    this.flags = moved(new Uint8Array(slots), this.flags);
    this.hole = moved(new Float32Array(slots), this.hole);
    this.holeSd = moved(new Float32Array(slots), this.holeSd);
    this.holeX = moved(new Float32Array(slots), this.holeX);
    this.holeArc = moved(new Float32Array(slots), this.holeArc);
    this.seenLow = moved(new Uint32Array(slots), this.seenLow);
    this.seenHigh = moved(new Uint32Array(slots), this.seenHigh);
    this.base = base;
    this.slots = slots;
  }
}
