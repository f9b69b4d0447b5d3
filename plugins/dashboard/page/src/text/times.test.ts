import { expect, it } from "vitest";
import { utcOf } from "./times";

it("UTC of a dive time is stated where it is known", () => {
  expect(utcOf({ begun_utc_s: Date.UTC(2026, 7, 30, 14, 30) / 1000 }, 725)).toBe("2026-08-30 14:42:05 UTC");
  expect(utcOf({ begun_utc_s: null }, 725)).toBe("");
});
