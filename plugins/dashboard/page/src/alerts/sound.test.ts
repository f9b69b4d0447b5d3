import { expect, it } from "vitest";
import type { Alert } from "../feed/types";
import { sounding } from "./sound";

const alert = (over: Partial<Alert>): Alert => ({
  number: 1, priority: "warning", class: "speed", kind: "too_fast", text: "", advice: null, state: "active", since_s: 0,
  rectified_s: null, cleared_s: null, acknowledged: null, silenced_until_s: null, sounds: true, needs_acknowledgement: true,
  from_m: null, to_m: null, back_to_m: null, at_most_mps: null, sensor: null, count: 1, ...over,
});

it("the most severe active alert sounds; silenced, muted, acknowledged and cleared alerts do not", () => {
  expect(sounding([alert({}), alert({ priority: "alarm", class: "coverage" })], [])).toBe("alarm");
  expect(sounding([alert({}), alert({ priority: "alarm", class: "coverage" })], ["coverage"])).toBe("warning");
  expect(sounding([alert({ sounds: false })], [])).toBeNull();
  expect(sounding([alert({ acknowledged: { by: "AB", at_s: 1 } })], [])).toBeNull();
  expect(sounding([alert({ state: "rectified" })], [])).toBeNull();
});
