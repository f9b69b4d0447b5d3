// Changes the view of the wall, by keys, wheel, pinch and buttons.
import { store } from "../store/store";
import { Topic } from "../store/topic";
import { FOLLOW_SPAN_M, followed, moved, movedDown, startView, wholeView, zoomed, zoomedDown, type View } from "./view";

export const viewTopic = new Topic();
export let view: View = startView();
let direction = 1;
let last_m: number | null = null;

export function set(next: View): void {
  view = next;
  viewTopic.changed();
}

/** Chainages of the coverage extent, as far as the page has its sections. */
export function wayOf(): [number, number] {
  const { sections, hello } = store;
  if (sections.least > sections.most || !hello) return [0, 0];
  return [sections.least * hello.section_m, (sections.most + 1) * hello.section_m];
}

/** The whole tunnel, or the coverage extent if the tunnel's length is unknown. */
export function whole(): [number, number] {
  const way = wayOf();
  return [Math.min(0, way[0]), Math.max(store.hello?.length_m ?? 0, way[1], 10)];
}

/** Present or last position of the vehicle, and its direction. */
export function vehicle(): { at_m: number; sd_m: number; direction: number; sure: boolean } | null {
  const { state } = store;
  const at_m = state?.position.chainage_m ?? null;
  if (at_m !== null) last_m = at_m;
  const speed = state?.speed_mps ?? 0;
  if (Math.abs(speed) > 0.02) direction = Math.sign(speed);
  if (last_m === null) return null;
  return { at_m: last_m, sd_m: state?.position.chainage_sd_m ?? 0, direction, sure: state?.position.state === "ok" };
}

/** The view as drawn, which moves with the vehicle if the view follows it. */
export function current(): View {
  const its = vehicle();
  if (view.whole) return wholeView(view, ...whole());
  if (!view.follow) return view;
  if (its) return followed(view, its.at_m, its.direction, whole()[0]);
  const way = wayOf();
  return { ...view, centre_m: way[1] };
}

export const actions = {
  zoom(factor: number, at = 0.5): void {
    const [from, to] = whole();
    const now = current();
    const next = zoomed(now, factor, at, to - from);
    // Zooming keeps a view that follows the vehicle on the vehicle.
    set(view.follow ? { ...next, follow: true } : next);
  },
  pan(share: number): void {
    const now = current();
    set(moved(now, share * now.span_m));
  },
  down(by: number): void {
    set(movedDown(current(), by));
  },
  zoomDown(factor: number): void {
    const next = zoomedDown(current(), factor);
    set(next.zoomDown === 1 ? { ...next, centreDown: 0.5 } : next);
  },
  follow(): void {
    set({ ...startView(), span_m: Math.min(view.span_m, FOLLOW_SPAN_M) });
  },
  whole(): void {
    const [from, to] = whole();
    set(wholeView(view, from, to));
  },
  goTo(x_m: number, span_m?: number): void {
    const now = current();
    set({ ...now, centre_m: x_m, span_m: span_m ?? now.span_m, follow: false, whole: false });
  },
};
