import { describe, expect, it } from "vitest";
import { clock, figure, heading, span, speedDown, station, stretch } from "./format";

describe("formatting", () => {
  it("writes chainage as stations", () => {
    expect(station(1240)).toBe("1+240.0");
    expect(station(1240.5, 2)).toBe("1+240.50");
    expect(station(7)).toBe("0+007.0");
    expect(station(999.96)).toBe("1+000.0");
    expect(station(-3.2, 1)).toBe("-0+003.2");
    expect(station(-0.01, 1)).toBe("0+000.0");
  });
  it("rounds stretches outward, in either direction", () => {
    expect(stretch(16.25, 10.75)).toBe("0+016.3–0+010.7");
    expect(stretch(10.75, 16.25)).toBe("0+010.7–0+016.3");
    expect(stretch(8.3, 8.6)).toBe("0+008.3–0+008.6");
  });
  it("rounds largest speeds down", () => {
    expect(speedDown(0.0925)).toBe("0.092");
    expect(speedDown(0.08)).toBe("0.080");
    expect(speedDown(0.119)).toBe("0.11");
    expect(speedDown(0.29)).toBe("0.29");
  });
  it("writes the side of a heading", () => {
    expect(heading(1.25)).toBe("1.3° left");
    expect(heading(-0.66)).toBe("0.7° right");
    expect(heading(-0.04)).toBe("0.0°");
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
