import { expect, it, vi } from "vitest";
import type { Alert, State } from "../feed/types";
import { Store } from "./store";

it("alerts have the figures of the latest state", () => {
  vi.stubGlobal("document", { hidden: true });
  const store = new Store();
  const alert = { number: 3, state: "active", text: "position ±0.13 m" } as Alert;
  store.take({ type: "alert_change", change: "raised", alert });
  const state = { type: "state", now_s: 1, at_s: null, alert_list: [{ ...alert, text: "position ±0.20 m" }, { ...alert, number: 4 }] };
  store.take(state as unknown as State);
  expect([...store.alerts.values()].map(({ number, text }) => [number, text])).toEqual([[3, "position ±0.20 m"]]);
});
