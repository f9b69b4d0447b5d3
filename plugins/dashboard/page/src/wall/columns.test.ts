import { describe, expect, it } from "vitest";
import { frameOf } from "../feed/binary";
import { FAIL, OPEN, PASS, Sections } from "../store/sections";
import { ABSENT, columns, FLAGGED_BIT, RATIO_STEPS } from "./columns";

function frame(records: { index: number; verdict: number; flags?: number; hole: number; low?: number }[]) {
  const out = new DataView(new ArrayBuffer(16 + records.length * 32));
  out.setUint8(0, 1);
  out.setUint8(1, 1);
  out.setUint32(4, records.length, true);
  records.forEach((record, n) => {
    const at = 16 + n * 32;
    out.setInt32(at, record.index, true);
    out.setUint8(at + 4, record.verdict);
    out.setUint8(at + 7, record.flags ?? 0);
    out.setFloat32(at + 8, record.hole, true);
    out.setUint32(at + 24, record.low ?? 0, true);
  });
  return frameOf(out.buffer);
}

describe("columns of the wall", () => {
  it("show the worst verdict and the largest hole of the sections in a pixel", () => {
    const sections = new Sections();
    sections.take(frame([
      { index: 0, verdict: PASS, hole: 0.2, low: 1 }, { index: 1, verdict: FAIL, flags: 1, hole: 0.9, low: 2 },
      { index: 2, verdict: PASS, hole: 0.3 }, { index: 3, verdict: PASS, hole: NaN },
    ]));
    const out = new Uint32Array(3 * 4);
    columns(sections, 0.25, 0.5, 0, 0.5, 3, out);
    expect(out[0]! & 7).toBe(FAIL);
    expect(out[0]! & FLAGGED_BIT).toBe(FLAGGED_BIT);
    expect(out[0]! >>> 16).toBe(Math.round((Math.fround(0.9) / 0.5) * RATIO_STEPS));
    expect(out[1]).toBe(3);
    expect(out[4]! & 7).toBe(PASS);
    expect(out[8]! & 7).toBe(ABSENT);
  });
  it("show the verdict for the second target", () => {
    const sections = new Sections();
    // The first section passes for the dive's own target and fails for the second target. The second section has no
    // comparison.
    sections.take(frame([{ index: 0, verdict: PASS, flags: 2 | ((FAIL + 1) << 2), hole: 0.4 }, { index: 1, verdict: PASS, flags: 2, hole: 0.4 }]));
    const own = new Uint32Array(2 * 4), other = new Uint32Array(2 * 4);
    columns(sections, 1, 0.5, 0, 1, 2, own);
    columns(sections, 1, 0.25, 0, 1, 2, other, "compared");
    expect([own[0]! & 15, other[0]! & 15]).toEqual([PASS, FAIL | FLAGGED_BIT]);
    expect(other[0]! >>> 16).toBe(Math.round((Math.fround(0.4) / 0.25) * RATIO_STEPS));
    expect(other[4]! & 7).toBe(OPEN);
  });
  it("widen a flag of a single pixel within the coverage extent", () => {
    const sections = new Sections();
    sections.take(frame([-3, -2, -1, 0, 1, 2, 3].map((index) => ({ index, verdict: index === 0 ? FAIL : PASS, flags: index === 0 ? 1 : 0, hole: 0.4 }))));
    const out = new Uint32Array(7 * 4);
    columns(sections, 1, 0.5, -3, 1, 7, out);
    const flagged = [0, 1, 2, 3, 4, 5, 6].filter((column) => (out[column * 4]! & FLAGGED_BIT) !== 0);
    expect(flagged).toEqual([2, 3, 4]);
  });
  it("grow in both directions and keep received data", () => {
    const sections = new Sections();
    sections.take(frame([{ index: 5000, verdict: PASS, hole: 0.1 }]));
    sections.take(frame([{ index: -40, verdict: FAIL, hole: 0.7 }]));
    sections.take(frame([{ index: 30000, verdict: PASS, hole: 0.2 }]));
    expect(sections.verdict[sections.slot(-40)]).toBe(FAIL);
    expect(sections.hole[sections.slot(5000)]).toBeCloseTo(0.1);
    expect(sections.slot(4999)).toBe(-1);
    expect([sections.least, sections.most]).toEqual([-40, 30000]);
  });
});
