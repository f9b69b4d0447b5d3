// Times of the dive: seconds of dive time, and UTC if the log states it.
import type { Hello } from "../feed/types";

type Zero = Pick<Hello, "begun_utc_s"> | null;

/** UTC of a dive time: 2026-08-30 14:32:10 UTC. Empty if unknown. */
export function utcOf(hello: Zero, at_s: number): string {
  const zero_s = hello?.begun_utc_s ?? null;
  return zero_s === null ? "" : `${new Date((zero_s + at_s) * 1000).toISOString().slice(0, 19).replace("T", " ")} UTC`;
}
