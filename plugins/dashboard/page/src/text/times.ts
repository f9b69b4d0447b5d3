// Times of the dive: seconds since its beginning, and UTC if the log states it.
import type { Hello } from "../feed/types";
import { clock } from "./format";

type Zero = Pick<Hello, "begun_s" | "utc_of_zero_s"> | null;

/** Dive time of a time on the log's clock: 12:05. */
export function diveTime(hello: Zero, at_s: number): string {
  return clock(at_s - (hello?.begun_s ?? 0));
}

/** UTC of a time on the log's clock: 2026-08-30 14:32:10 UTC. Empty if unknown. */
export function utcOf(hello: Zero, at_s: number): string {
  const zero_s = hello?.utc_of_zero_s ?? null;
  return zero_s === null ? "" : `${new Date((zero_s + at_s) * 1000).toISOString().slice(0, 19).replace("T", " ")} UTC`;
}
