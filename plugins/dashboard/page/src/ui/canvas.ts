// A canvas as large as its container, in device pixels.
import { useEffect, useRef } from "preact/hooks";

export interface Size { width: number; height: number; scale: number }

/** Calls `changed` when the element's size changes; returns the element's ref. */
export function useSize<E extends HTMLElement>(changed: (size: Size) => void) {
  const element = useRef<E>(null);
  const latest = useRef(changed);
  latest.current = changed;
  useEffect(() => {
    const its = element.current;
    if (!its) return undefined;
    const observer = new ResizeObserver(() => {
      latest.current({ width: its.clientWidth, height: its.clientHeight, scale: Math.min(devicePixelRatio || 1, 2) });
    });
    observer.observe(its);
    return () => observer.disconnect();
  }, []);
  return element;
}

export function fit(canvas: HTMLCanvasElement, { width, height, scale }: Size): void {
  const w = Math.max(1, Math.round(width * scale)), h = Math.max(1, Math.round(height * scale));
  if (canvas.width !== w) canvas.width = w;
  if (canvas.height !== h) canvas.height = h;
}
