// Returns of each head in the present turn and the one before. A turn ends after 360 degrees, or when the head
// reverses.
import { SAMPLE_BYTES, type Frame } from "../feed/binary";

export interface Return { t_s: number; x_m: number; y_m: number; z_m: number; arc: number; outcome: number }

/** Number of steps against the direction of a sweep that count as a reversal; fewer are jitter. */
const REVERSED_STEPS = 4;
/** A head with more returns than this in one turn has stopped turning. */
const MOST_RETURNS = 4000;

export class HeadTurns {
  present: Return[] = [];
  last: Return[] = [];
  private swept = 0;
  private direction = 0;
  private against = 0;

  take(next: Return): void {
    const before = this.present.at(-1);
    // After a jump in time (a seek or a gap), both turns start again.
    if (before && (next.t_s < before.t_s || next.t_s > before.t_s + 60)) this.clear();
    else if (before) this.turn(next.arc - before.arc);
    this.present.push(next);
  }

  clear(): void {
    this.present = [];
    this.last = [];
    this.swept = this.direction = this.against = 0;
  }

  private turn(step: number): void {
    const shortest = step - Math.round(step);
    this.swept += Math.abs(shortest);
    const sign = Math.sign(shortest);
    if (this.direction === 0) this.direction = sign;
    this.against = sign !== 0 && sign !== this.direction ? this.against + 1 : 0;
    const reversed = this.against >= REVERSED_STEPS;
    if (this.swept < 1 && !reversed && this.present.length < MOST_RETURNS) return;
    this.last = this.present;
    this.present = [];
    this.swept = 0;
    this.against = 0;
    if (reversed) this.direction = sign;
  }
}

export class Turns {
  heads: HeadTurns[] = [];

  clear(): void {
    this.heads = [];
  }

  take(frame: Frame): void {
    const { view, count } = frame;
    for (let at = 0; at < count * SAMPLE_BYTES; at += SAMPLE_BYTES) {
      const head = view.getUint8(at + 18);
      while (this.heads.length <= head) this.heads.push(new HeadTurns());
      this.heads[head]?.take({
        t_s: view.getUint32(at, true) / 1000,
        x_m: view.getFloat32(at + 4, true),
        y_m: view.getFloat32(at + 8, true),
        z_m: view.getFloat32(at + 12, true),
        arc: view.getUint16(at + 16, true) / 65536,
        outcome: view.getUint8(at + 19),
      });
    }
  }
}
