import { describe, expect, it } from "vitest";
import { downOf, followed, heightOf, left_m, right_m, roundOf, startView, zoomed } from "./view";

describe("the wall's view", () => {
  // A circle with a perimeter of 20 m. Arc length starts at the floor and passes the left wall (9), the crown (12)
  // and the right wall (3).
  const clock = Array.from({ length: 12 }, (_, hour) => (10 + (hour * 20) / 12) % 20);
  it("runs down from 12 by way of 3, 6 and 9", () => {
    const round = roundOf(clock, 20);
    expect(clock.map((arc) => Math.round(downOf(round, arc / 20) * 12) % 12)).toEqual([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]);
    expect(heightOf(startView(), downOf(round, clock[3]! / 20))).toBeCloseTo(0.25);
  });
  it("runs in the same direction if arc length counts the other way round", () => {
    const other = clock.map((arc) => (20 - arc) % 20), round = roundOf(other, 20);
    expect(round.sign).toBe(-1);
    expect(Math.round(downOf(round, other[9]! / 20) * 12)).toBe(9);
  });
  it("keeps the place under the pointer when zooming", () => {
    const view = { ...startView(), follow: false, centre_m: 500, span_m: 100 };
    const at_m = left_m(view) + 0.2 * view.span_m, next = zoomed(view, 0.5, 0.2, 7000);
    expect(next.span_m).toBe(50);
    expect(left_m(next) + 0.2 * next.span_m).toBeCloseTo(at_m);
  });
  it("follows with most of the width behind the vehicle, and little before the portal", () => {
    const far = followed(startView(), 1000, 1, 0), back = followed(startView(), 1000, -1, 0), near = followed(startView(), 5, 1, 0);
    expect(1000 - left_m(far)).toBeGreaterThan(right_m(far) - 1000);
    expect(1000 - left_m(back)).toBeLessThan(right_m(back) - 1000);
    expect(left_m(near)).toBeGreaterThan(-5);
    expect(right_m(near)).toBeGreaterThan(5);
  });
});
