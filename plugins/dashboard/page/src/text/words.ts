// Texts of conditions and codes, from the table of words.
import type { Lamp, State } from "../feed/types";
import { figure, span } from "./format";
import { CONDITIONS, POSITION_WHY, STAND_STILL, STARTING } from "./table";

/** The displayed condition: that of the loop, or a message that no data arrive from the loop. */
export interface Shown { word: string; advice: string; lamp: Lamp; old: boolean }

/** Text of a cause or reason: `too_fast` becomes "too fast". */
export function plain(name: string): string {
  return name.replaceAll("_", " ");
}

/** Text of the reason for a position's state; empty if there is none. */
export function positionWhy(why: State["position"]["why"] | undefined): string {
  return why ? (POSITION_WHY[why] ?? plain(why)) : "";
}

/** Name and advice for data of this age. */
export function oldWords(age_s: number): { word: string; advice: string } {
  const { name, detail, action } = CONDITIONS.old;
  return { word: `${name} ${span(age_s)}`, advice: `${detail}: ${action}` };
}

/** Name and advice for a state's condition. */
export function conditionWords(state: State): { word: string; advice: string } {
  const { condition, position, v_max_mps } = state;
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
  if (speed !== "" && v_max_mps !== null) does = `${speed} ${figure(v_max_mps, 2)} m/s`;
  if (condition === "cannot_say" && position.why === "spread" && position.stand_s > 0) does = `${STAND_STILL} ${position.stand_s} s`;
  return { word: name.toUpperCase(), advice: [why, does].filter((part) => part !== "").join(": ") };
}
