import { describe, expect, it } from "vitest";
import type { Alert } from "../feed/types";
import { sorted } from "./alerts";

function alert(number: number, over: Partial<Alert>): Alert {
  return {
    number, priority: "alarm", class: "coverage", kind: "missed", text: "", advice: null, state: "active", since_s: number,
    rectified_s: null, cleared_s: null, acknowledged: null, silenced_until_s: null, sounds: true, needs_acknowledgement: true,
    from_m: null, to_m: null, back_to_m: null, at_most_mps: null, sensor: null, count: 1, ...over,
  };
}

describe("alerts", () => {
  it("are listed in the order of maritime practice, newest first within a rank", () => {
    const by = { by: "AB", at_s: 1 };
    const list = [
      alert(1, { priority: "caution", needs_acknowledgement: false }),
      alert(2, { acknowledged: by }),
      alert(3, { state: "rectified" }),
      alert(4, { priority: "warning" }),
      alert(5, {}), alert(6, {}),
      alert(7, { priority: "emergency_alarm" }),
      alert(8, { state: "cleared", acknowledged: by }),
      alert(9, { state: "rectified", priority: "warning" }),
    ];
    expect(sorted(list).map((each) => each.number)).toEqual([7, 6, 5, 4, 9, 3, 2, 1]);
  });
});
