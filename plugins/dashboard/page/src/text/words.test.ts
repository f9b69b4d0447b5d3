import { expect, it } from "vitest";
import type { State } from "../feed/types";
import { conditionWords, speedsOf } from "./words";

const state = (over: Partial<State>): State => ({
  condition: "good", speed_mps: -0.0904, v_max_mps: 0.0943, margins: { speed_mps: 0.0039, turn_m: null, position_m: null, lost_share: null },
  position: { state: "ok", why: null }, sensors: [], ...over,
} as unknown as State);

it("ready speed texts are used as they are, also in the advice", () => {
  const speeds = { speed: "0.090", limit: "0.094", margin: "0.004 to spare" };
  expect(speedsOf(state({ speeds }))).toBe(speeds);
  expect(conditionWords(state({ speeds })).advice).toMatch(/ 0\.094 m\/s$/);
});
it("the advice names no speed if no limit applies", () => {
  const speeds = { speed: "0.090", limit: null, margin: null };
  expect(conditionWords(state({ speeds, condition: "turn_fails" })).advice).not.toMatch(/\d/);
});
it("files without ready speed texts show numbers, and no limit on the way back", () => {
  expect(speedsOf(state({}))).toEqual({ speed: "0.09", limit: "0.09", margin: "0.00 to spare" });
  expect(speedsOf(state({ condition: "going_back" }))).toEqual({ speed: "0.09", limit: null, margin: null });
});
