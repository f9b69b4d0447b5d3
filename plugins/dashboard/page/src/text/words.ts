// Texts of conditions and codes, from the table of words.
import type { Condition, Lamp, Speeds, State } from "../feed/types";
import { figure, span } from "./format";
import { CONDITIONS, POSITION_WHY, STAND_STILL, STARTING } from "./table";

/** The displayed condition: that of the loop, or a message that no data arrive from the loop. */
export interface Shown { word: string; advice: string; lamp: Lamp | "ended"; old: boolean }

/** Text if nothing limits the speed. */
export const UNBOUNDED: Partial<Record<Condition, string>> = {
  passed: "the wall here has passed",
  going_back: "nothing limits the speed on the way",
  outside: "no verdicts here",
};

/** Text of a cause or reason: `too_fast` becomes "too fast". */
export function plain(name: string): string {
  return name.replaceAll("_", " ");
}

/** Text of the reason for a position's state; empty if there is none. */
export function positionWhy(why: State["position"]["why"] | undefined): string {
  return why ? (POSITION_WHY[why] ?? plain(why)) : "";
}

/** Speed, limit and margin as text. Files of earlier versions have only the numbers. */
export function speedsOf({ speeds, speed_mps, v_max_mps, margins, condition }: State): Speeds {
  if (speeds) return speeds;
  const speed = speed_mps === null ? null : figure(Math.abs(speed_mps), 2);
  if (condition in UNBOUNDED || v_max_mps === null) return { speed, limit: null, margin: null };
  const spare = margins.speed_mps;
  const margin = spare === null ? null : `${figure(Math.abs(spare), 2)} ${spare >= 0 ? "to spare" : "too fast"}`;
  return { speed, limit: figure(v_max_mps, 2), margin };
}

/** Name and advice for data of this age. */
export function oldWords(age_s: number): { word: string; advice: string } {
  const { name, detail, action } = CONDITIONS.old;
  return { word: `${name} ${span(age_s)}`, advice: `${detail}: ${action}` };
}

/** Name and advice for a state's condition. */
export function conditionWords(state: State): { word: string; advice: string } {
  const { condition, position } = state, { limit } = speedsOf(state);
  // A page that stays open may meet a newer program with other conditions.
  if (!(condition in CONDITIONS)) return { word: state.text, advice: "" };
  if (condition === "old") return oldWords(state.age_s ?? 0);
  if (condition === "no_data" && state.sensors.some(({ age_s }) => age_s !== null)) return { word: STARTING, advice: "" };
  const { name, detail, action, speed } = CONDITIONS[condition];
  let why: string = detail, does: string = action;
  // The advice may lack a heading although the state has a position.
  if (condition === "no_position") why = positionWhy(position.state === "none" ? position.why : "no_heading");
  if (condition === "cannot_say") why = positionWhy(position.why);
  if (condition === "no_speed") why = state.remedy ?? detail;
  if (speed !== "" && limit !== null) does = `${speed} ${limit} m/s`;
  if (condition === "cannot_say" && position.why === "spread" && position.stand_s > 0) does = `${STAND_STILL} ${position.stand_s} s`;
  return { word: name.toUpperCase(), advice: [why, does].filter((part) => part !== "").join(": ") };
}
