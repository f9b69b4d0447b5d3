import { expect, it } from "vitest";
import { marks, scaleEnd } from "./gauge";

it("speed and v_max stay on the scale", () => {
  for (const [speed, most] of [[0.18, 0.24], [0.6, 0.07], [-0.3, 0.2], [0, 0], [7.3, 0.2]] as const) {
    const end = scaleEnd(speed, most);
    expect(end).toBeGreaterThanOrEqual(Math.abs(speed));
    expect(end).toBeGreaterThanOrEqual(most * 1.5);
    const on = marks(end);
    expect(on[0]).toBe(0);
    expect(on.at(-1)!).toBeLessThanOrEqual(end + 1e-9);
    expect(on.length).toBeLessThan(12);
  }
});
