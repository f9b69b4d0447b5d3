// The page's only table of texts for conditions, verdicts and reasons.
import type { Condition, Lamp, State } from "../feed/types";
import { figure, span } from "./format";

/** The displayed condition: that of the loop, or a message that no data arrive from the loop. */
export interface Shown { word: string; advice: string; lamp: Lamp; old: boolean }

export const REASONS: Record<string, string> = {
  helix_pitch: "turns too far apart: go slower",
  angular_step: "samples too far apart along the wall: slower won't help",
  no_heading_or_fix: "no heading or position",
  no_returns: "no returns from the wall",
};

export const POSITION_WHY: Record<string, string> = {
  cable: "cable counter doubtful",
  spread: "position drifts between passes",
  no_heading: "no heading",
  no_chainage: "no chainage",
  no_place_in_section: "lateral position unknown",
};

export const VERDICTS = {
  pass_m: "pass", fail_m: "missed", cannot_say_m: "can't say", open_m: "open", not_inspected_m: "not inspected",
} as const;

export const SENSOR_STATES: Record<string, string> = {
  ok: "ok", silent: "silent", never: "no data yet", stalled: "doesn't turn", deaf: "detects no wall", hung: "stuck", distrusted: "not trusted",
};

/** Text of a cause or reason: `too_fast` becomes "too fast". */
export function plain(name: string): string {
  return name.replaceAll("_", " ");
}

export function atMost(state: State): string {
  return state.v_max_mps === null ? "" : `at most ${figure(state.v_max_mps, 2)} m/s`;
}

/** Name and advice for a state's condition. */
export function conditionWords(state: State): { word: string; advice: string } {
  const most = atMost(state);
  const slower = most === "" ? "slower" : `slow to ${figure(state.v_max_mps, 2)} m/s`;
  // Heads that are mounted apart along the hull and turn out of phase can miss wall below v_max.
  // Going slower would then make it worse, so the advice is v_max itself.
  const go = most === "" ? "" : `go ${figure(state.v_max_mps, 2)} m/s`;
  const stand = state.position.why === "spread" && state.position.stand_s > 0 ? `stand still ${state.position.stand_s} s` : most;
  const words: Record<Condition, [string, string]> = {
    no_data: ["WAITING", "for the first data"],
    old: [`OLD ${span(state.age_s ?? 0)}`, "nothing from any sensor: stop"],
    no_position: ["NO POSITION", `${POSITION_WHY[state.position.why ?? ""] ?? "no position"}: hold still`],
    outside: ["OUTSIDE", "no head is within the tunnel"],
    no_sonar: ["NO SONAR", "no returns: stop"],
    passed: ["PASSED HERE", "any speed will do"],
    going_back: ["GOING BACK", "to a missed section: any speed will do"],
    no_speed: ["SLOWER WON'T HELP", state.remedy ?? "no speed meets the target here"],
    too_fast: ["TOO FAST", slower],
    turn_fails: ["THIS TURN MISSES", go],
    turn_unsure: ["THIS TURN MAY MISS", go],
    cannot_say: ["CAN'T SAY", `${POSITION_WHY[state.position.why ?? ""] ?? "position too uncertain"}${stand === "" ? "" : `: ${stand}`}`],
    over: ["A LITTLE FAST", slower],
    good: ["GOOD", most === "" ? "" : `may go up to ${figure(state.v_max_mps, 2)} m/s`],
  };
  const [word, advice] = words[state.condition] ?? [state.text, ""];
  return { word, advice };
}
