import { expect, it } from "vitest";
import { diveTime, utcOf } from "./times";

it("times count from the begin of the dive, with UTC where it is known", () => {
  const hello = { begun_s: 100, utc_of_zero_s: Date.UTC(2026, 7, 30, 14, 30) / 1000 };
  expect(diveTime(hello, 825)).toBe("12:05");
  expect(utcOf(hello, 825)).toBe("2026-08-30 14:43:45 UTC");
  expect(utcOf({ ...hello, utc_of_zero_s: null }, 825)).toBe("");
});
