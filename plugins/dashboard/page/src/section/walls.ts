// Distances to the wall from the echosounders.
import type { Echosounder } from "../feed/types";
import { figure } from "../text/format";

/** A wall nearer than this raises a warning on the page, m. At 0.2 m/s it leaves 2.5 s to react. */
export const CLOSE_M = 0.5;
/** A reading older than this counts as silent, s. It is the age above which all data of the page count as old. */
const FRESH_S = 2;

export function isFresh({ age_s }: Echosounder): boolean {
  return age_s !== null && age_s <= FRESH_S;
}

export function isClose(echo: Echosounder): boolean {
  return isFresh(echo) && echo.range_m !== null && echo.range_m < CLOSE_M;
}

/** Side of the cross-section that a beam points to, looking inwards. y grows to the left. */
export function sideOf({ from, to }: Echosounder): "left" | "right" | "up" | "down" | null {
  if (!to) return null;
  const y = to[0] - from[0], z = to[1] - from[1];
  if (Math.abs(y) >= Math.abs(z)) return y > 0 ? "left" : "right";
  return z > 0 ? "up" : "down";
}

/** Warning about the nearest wall if it is close: WALL 0.42 m, right. Empty otherwise. */
export function wallWarning(echosounders: Echosounder[]): string {
  const [nearest] = echosounders.filter(isClose).sort((a, b) => (a.range_m ?? 0) - (b.range_m ?? 0));
  if (!nearest) return "";
  return [`WALL ${figure(nearest.range_m, 2)} m`, sideOf(nearest)].filter((part) => part !== null).join(", ");
}
