// Age of the displayed data, and text about the age.
import { metres, span } from "../text/format";
import { CONDITIONS, VERDICTS } from "../text/table";
import type { Metres } from "../feed/types";
import { conditionWords, oldWords, type Shown } from "../text/words";
import type { Store } from "./store";

/** Data older than this is displayed as old, as in the loop. */
export const OLD_AFTER_S = 2;

/** Whether time is paused on purpose, so that displayed data doesn't age. */
export function stands(store: Store): boolean {
  return store.link.phase === "file" || hasEnded(store) || store.state?.playback?.paused === true;
}

/** Whether the dive has ended, so that no more data arrive. */
export function hasEnded(store: Store): boolean {
  return store.end !== null || store.state?.ended === true;
}

/** Lengths by verdict. The result's lengths replace the lengths of the last state, whose verdicts are not all final. */
export function metresOf({ end, state }: Store): Metres | null {
  const sums = end?.summary;
  if (!sums) return state?.metres ?? null;
  const { pass_m, fail_m, cannot_say_m, open_m, not_inspected_m } = sums;
  return { pass_m, fail_m, cannot_say_m, open_m, not_inspected_m, way_m: end?.way?.length_m ?? state?.metres.way_m ?? 0 };
}

/** Text about missed sections that are still to be passed; null if there are none. Files of earlier versions have only their length. */
export function outstandingOf(store: Store): string | null {
  const { state } = store, fail_m = metresOf(store)?.fail_m ?? 0;
  if (state?.outstanding !== undefined) return state.outstanding;
  return fail_m > 0 ? `${metres(fail_m)} ${VERDICTS.fail}` : null;
}

/** Seconds since the state arrived. */
export function sinceState_s(store: Store): number {
  return stands(store) ? 0 : Math.max(0, (performance.now() - store.state_ms) / 1000);
}

/** Age of the data, seconds; null before the first. */
export function age_s(store: Store): number | null {
  const { state } = store;
  if (!state || state.age_s === null) return null;
  // The loop's age is that at the state's arrival, so the time since then is added.
  return state.age_s + sinceState_s(store);
}

export function isOld(store: Store): boolean {
  const age = age_s(store);
  return store.state !== null && (store.state.old || (age !== null && age > OLD_AFTER_S) || sinceState_s(store) > OLD_AFTER_S);
}

/** Seconds since the connection was lost; null while it is up. */
export function lost_s(store: Store): number | null {
  const { phase, heard_ms, since_ms } = store.link;
  if (phase === "open" || phase === "file") return null;
  return (performance.now() - (heard_ms || since_ms)) / 1000;
}

/** The condition as displayed. */
export function shown(store: Store): Shown {
  const { state, link } = store;
  const lost = lost_s(store);
  if (link.phase === "refused") return { word: "NO ACCESS", advice: "a token is needed", lamp: "amber", old: true };
  if (!state) {
    const advice = link.phase === "open" ? "for the dive's state" : `for the program, ${span(lost ?? 0)}`;
    return { word: CONDITIONS.no_data.name, advice, lamp: "amber", old: true };
  }
  const gone = sinceState_s(store);
  const readAgain_pct = state.recording?.read_again_pct ?? null;
  if (readAgain_pct !== null) {
    return { word: "RESUMING", advice: `reading the dive so far again: ${readAgain_pct} %`, lamp: "amber", old: false };
  }
  if (hasEnded(store)) {
    return { word: "DIVE ENDED", advice: "all verdicts are final", lamp: "ended", old: false };
  }
  if (lost !== null && (lost > OLD_AFTER_S || gone > OLD_AFTER_S)) {
    return { word: "NO CONNECTION", advice: `for ${span(Math.max(lost, gone))}: all data here is old`, lamp: "red", old: true };
  }
  if (isOld(store)) {
    const age = age_s(store) ?? gone;
    return { ...oldWords(age), lamp: "red", old: true };
  }
  return { ...conditionWords(state), lamp: state.lamp, old: false };
}
