// Wheel, drag, pinch and clicks on the wall.
import type { RefObject } from "preact";
import { useEffect } from "preact/hooks";
import { actions, current, set } from "./control";
import type { Painter } from "./Wall";
import { left_m, moved, movedDown } from "./view";

export function usePointer(box: RefObject<HTMLDivElement | null>, painter: RefObject<Painter | null>, say: (text: string) => void): void {
  useEffect(() => {
    const element = box.current;
    if (!element) return undefined;
    const held = new Map<number, { x: number; y: number }>();
    let apart = 0;
    const place = (event: MouseEvent) => {
      const bounds = element.getBoundingClientRect();
      return { x: event.clientX - bounds.left, y: event.clientY - bounds.top };
    };
    const share = (x: number) => {
      const layout = painter.current?.layout;
      return layout ? Math.min(Math.max((x - layout.left) / layout.width, 0), 1) : 0.5;
    };
    const onStrip = ({ x, y }: { x: number; y: number }): boolean => {
      const its = painter.current;
      if (!its || its.layout.stripHeight === 0 || y < its.layout.stripTop) return false;
      const strip = its.stripView();
      actions.goTo(left_m(strip) + share(x) * strip.span_m);
      return true;
    };
    const wheel = (event: WheelEvent) => {
      event.preventDefault();
      const factor = Math.exp(Math.min(Math.max(event.deltaY, -200), 200) * 0.002);
      if (event.shiftKey) actions.zoomDown(1 / factor);
      else actions.zoom(factor, share(place(event).x));
    };
    const down = (event: PointerEvent) => {
      const at = place(event);
      if (onStrip(at)) return;
      element.setPointerCapture(event.pointerId);
      held.set(event.pointerId, at);
      apart = 0;
    };
    const move = (event: PointerEvent) => {
      const at = place(event), before = held.get(event.pointerId), layout = painter.current?.layout;
      if (!before || !layout) {
        say(painter.current?.at(at.x, at.y) ?? "");
        return;
      }
      held.set(event.pointerId, at);
      if (held.size === 2) {
        const [one, two] = [...held.values()];
        const now = Math.hypot((one?.x ?? 0) - (two?.x ?? 0), (one?.y ?? 0) - (two?.y ?? 0));
        if (apart > 0 && now > 0) actions.zoom(apart / now, share(((one?.x ?? 0) + (two?.x ?? 0)) / 2));
        apart = now;
        return;
      }
      if (Math.abs(at.x - before.x) + Math.abs(at.y - before.y) === 0) return;
      const view = current();
      const across = moved(view, (-(at.x - before.x) / layout.width) * view.span_m);
      set(view.zoomDown > 1 ? movedDown(across, -(at.y - before.y) / layout.height) : across);
    };
    const up = (event: PointerEvent) => {
      held.delete(event.pointerId);
      apart = 0;
    };
    const leave = () => say("");
    element.addEventListener("wheel", wheel, { passive: false });
    element.addEventListener("pointerdown", down);
    element.addEventListener("pointermove", move);
    element.addEventListener("pointerup", up);
    element.addEventListener("pointercancel", up);
    element.addEventListener("pointerleave", leave);
    return () => {
      element.removeEventListener("wheel", wheel);
      element.removeEventListener("pointerdown", down);
      element.removeEventListener("pointermove", move);
      element.removeEventListener("pointerup", up);
      element.removeEventListener("pointercancel", up);
      element.removeEventListener("pointerleave", leave);
    };
  }, []);
}
