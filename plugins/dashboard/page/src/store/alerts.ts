// Order of alerts, as IMO MSC.302(87) defines them.
import type { Alert } from "../feed/types";

export const isUnacknowledged = (alert: Alert): boolean => alert.needs_acknowledgement && alert.acknowledged === null;

/** Rank of an alert in lists; the lowest rank is the most urgent. */
export function rank(alert: Alert): number {
  const unacknowledged = isUnacknowledged(alert);
  if (alert.state === "active" && unacknowledged) {
    return { emergency_alarm: 0, alarm: 1, warning: 2, caution: 5 }[alert.priority];
  }
  if (alert.state === "rectified" && unacknowledged) return 3;
  return alert.priority === "caution" ? 5 : 4;
}

/** Alerts that aren't cleared, in the order of lists; newest first within a rank. */
export function sorted(alerts: Iterable<Alert>): Alert[] {
  const shown = [...alerts].filter((alert) => alert.state !== "cleared");
  return shown.sort((a, b) => rank(a) - rank(b) || b.since_s - a.since_s || b.number - a.number);
}
