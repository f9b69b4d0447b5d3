import { describe, expect, it } from "vitest";
import { clock, figure, span, station } from "./format";

describe("formatting", () => {
  it("writes chainage as stations", () => {
    expect(station(1240)).toBe("1+240");
    expect(station(1240.5, 2)).toBe("1+240.50");
    expect(station(7)).toBe("0+007");
    expect(station(999.6)).toBe("1+000");
    expect(station(-3.2, 1)).toBe("-0+003.2");
    expect(station(-0.01, 1)).toBe("0+000.0");
  });
  it("writes durations", () => {
    expect(span(0.44)).toBe("0.4 s");
    expect(span(32.2)).toBe("32 s");
    expect(span(245)).toBe("4 min 05 s");
    expect(span(3125)).toBe("52 min");
    expect(span(7980)).toBe("2 h 13 min");
  });
  it("writes clock times and numbers", () => {
    expect(clock(725)).toBe("12:05");
    expect(clock(3725)).toBe("1:02:05");
    expect(figure(-0.001, 2)).toBe("0.00");
    expect(figure(-0.5, 1)).toBe("−0.5");
    expect(figure(null, 1)).toBe("–");
  });
});
