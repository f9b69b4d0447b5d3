// Colours of the palette for canvases. They are read from the style sheet, so that only one table of colours exists.
import { prefsTopic } from "../store/prefs";

let cache = new Map<string, string>();
prefsTopic.on(() => (cache = new Map()));

/** A colour of the style sheet, such as `ink` for --ink: #rrggbb. */
export function colour(name: string): string {
  let value = cache.get(name);
  if (value === undefined) {
    value = getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim() || "#808080";
    cache.set(name, value);
  }
  return value;
}
