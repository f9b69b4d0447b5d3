// The visible part of the unrolled wall. Horizontal: chainage. Vertical: fraction of the perimeter, from the crown by
// way of 3 o'clock.

export interface View {
  /** Chainage at the middle of the view, m. */
  centre_m: number;
  /** Length of tunnel in the view, m. */
  span_m: number;
  /** Whether the view follows the vehicle. */
  follow: boolean;
  /** Whether the view shows the whole tunnel, however long it becomes. */
  whole: boolean;
  /** Height of one perimeter as a multiple of the view's height; 1 shows all clock positions. */
  zoomDown: number;
  /** Fraction of the perimeter, from the crown, at the middle of the view. */
  centreDown: number;
}

export const LEAST_SPAN_M = 1.5;
export const FOLLOW_SPAN_M = 60;
/** Share of the view's width that lies behind the vehicle in a view that follows it. */
const BEHIND = 0.78;

export function startView(): View {
  return { centre_m: 0, span_m: FOLLOW_SPAN_M, follow: true, whole: false, zoomDown: 1, centreDown: 0.5 };
}

export const left_m = (view: View): number => view.centre_m - view.span_m / 2;
export const right_m = (view: View): number => view.centre_m + view.span_m / 2;

/** Centres the view for a vehicle that moves inwards (1) or back (-1). Little of the range before the portal is shown. */
export function followed(view: View, at_m: number, direction: number, portal_m: number): View {
  const centre_m = at_m - direction * (BEHIND - 0.5) * view.span_m;
  const least_m = Math.min(portal_m, at_m) + 0.46 * view.span_m;
  return { ...view, centre_m: Math.max(centre_m, least_m) };
}

/** Zooms about a position across the width, 0 to 1. A factor below 1 zooms in. */
export function zoomed(view: View, factor: number, at: number, whole_m: number): View {
  const span_m = Math.min(Math.max(view.span_m * factor, LEAST_SPAN_M), Math.max(whole_m * 1.1, FOLLOW_SPAN_M));
  const fixed_m = left_m(view) + at * view.span_m;
  return { ...view, whole: false, span_m, centre_m: fixed_m + (0.5 - at) * span_m };
}

export function moved(view: View, by_m: number): View {
  return { ...view, centre_m: view.centre_m + by_m, follow: false, whole: false };
}

export function zoomedDown(view: View, factor: number): View {
  return { ...view, zoomDown: Math.min(Math.max(view.zoomDown * factor, 1), 16) };
}

export function movedDown(view: View, by: number): View {
  const down = view.centreDown + by / view.zoomDown;
  return { ...view, centreDown: down - Math.floor(down) };
}

/** Shows the whole range between two chainages. */
export function wholeView(view: View, from_m: number, to_m: number): View {
  const span_m = Math.max(to_m - from_m, LEAST_SPAN_M) * 1.04;
  return { ...view, span_m, centre_m: (from_m + to_m) / 2, follow: false, whole: true, zoomDown: 1, centreDown: 0.5 };
}

/** Fraction of the perimeter at the crown, and 1 if arc length grows from 12 o'clock towards 3, or -1 if it shrinks. */
export interface Round { crown: number; sign: number }

export function roundOf(clock_arc_m: number[], perimeter_m: number): Round {
  const crown = (clock_arc_m[0] ?? 0) / perimeter_m;
  const step = ((clock_arc_m[1] ?? 0) / perimeter_m - crown + 1) % 1;
  return { crown, sign: step < 0.5 ? 1 : -1 };
}

/** Converts an arc length, as a fraction of the perimeter, to the fraction from the crown, 0 to 1. */
export function downOf(round: Round, arc: number): number {
  const down = round.sign * (arc - round.crown);
  return down - Math.floor(down);
}

/** Converts a fraction of the perimeter to a height in the view: 0 is the top, 1 the bottom. The wall repeats every `zoomDown`. */
export function heightOf(view: View, down: number): number {
  return (down - view.centreDown) * view.zoomDown + 0.5;
}
