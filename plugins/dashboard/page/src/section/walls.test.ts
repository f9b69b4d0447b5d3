import { expect, it } from "vitest";
import { sideOf, wallWarning } from "./walls";

const echo = (range_m: number, to: [number, number], age_s = 0.1) => ({ id: "e", range_m, age_s, from: [0, 3] as [number, number], to });

it("the side of a beam comes from its direction in the cross-section", () => {
  expect([[2, 3.1], [-2, 2.5], [0.1, 6], [0.1, 0]].map((to) => sideOf(echo(2, to as [number, number])))).toEqual(["left", "right", "up", "down"]);
});
it("the nearest wall within 0.5 m is a warning, unless its echosounder is silent", () => {
  expect(wallWarning([echo(0.48, [0.48, 3]), echo(0.42, [-0.42, 3])])).toBe("WALL 0.42 m, right");
  expect(wallWarning([echo(0.5, [0.5, 3]), echo(1.9, [0, 4.9])])).toBe("");
  expect(wallWarning([echo(0.3, [0.3, 3], 5)])).toBe("");
});
