import { describe, expect, it } from "vitest";
import { HeadTurns } from "./turns";

const at = (t_s: number, arc: number) => ({ t_s, x_m: 0, y_m: 0, z_m: 0, arc: arc - Math.floor(arc), outcome: 0 });

describe("turns of a head", () => {
  it("end after a full turn, also across the seam", () => {
    const turns = new HeadTurns();
    for (let n = 0; n <= 150; n += 1) turns.take(at(n * 0.05, 0.7 + n / 100));
    // Returns 0 to 99 belong to the first turn, later returns to the second.
    expect(turns.last.length).toBe(100);
    expect(turns.present.length).toBe(51);
    expect(turns.present[0]?.t_s).toBeCloseTo(5);
  });
  it("end at a reversal, not at jitter", () => {
    const turns = new HeadTurns();
    for (let n = 0; n < 30; n += 1) turns.take(at(n, 0.1 + n / 100));
    turns.take(at(30, 0.38));
    turns.take(at(31, 0.39));
    expect(turns.last).toEqual([]);
    for (let n = 0; n < 10; n += 1) turns.take(at(32 + n, 0.38 - n / 100));
    expect(turns.last.length).toBeGreaterThan(30);
    expect(turns.present.length).toBeLessThan(10);
  });
  it("begin again after a jump in time", () => {
    const turns = new HeadTurns();
    for (let n = 0; n < 10; n += 1) turns.take(at(100 + n, n / 100));
    turns.take(at(20, 0.5));
    expect([turns.present.length, turns.last.length]).toEqual([1, 0]);
  });
});
