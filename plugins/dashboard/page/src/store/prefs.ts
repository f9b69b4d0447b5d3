// Settings of this viewer, kept in the browser's storage if it allows any.
import type { AlertClass } from "../feed/types";
import { Topic } from "./topic";

export type Palette = "day" | "dusk" | "night";
export const PALETTES: Palette[] = ["day", "dusk", "night"];

export interface Prefs { palette: Palette; sound: boolean; speech: boolean; muted: AlertClass[]; by: string; slow: boolean }

const KEY = "headrace.page";
const DEFAULTS: Prefs = { palette: "dusk", sound: true, speech: false, muted: [], by: "page", slow: false };

function load(): Prefs {
  try {
    return { ...DEFAULTS, ...(JSON.parse(localStorage.getItem(KEY) ?? "{}") as Partial<Prefs>) };
  } catch {
    return { ...DEFAULTS };
  }
}

export const prefsTopic = new Topic();
export let prefs: Prefs = load();

export function setPrefs(change: Partial<Prefs>): void {
  prefs = { ...prefs, ...change };
  try {
    localStorage.setItem(KEY, JSON.stringify(prefs));
  } catch {
    // Without storage in the browser, the setting lasts until the page is closed.
  }
  document.documentElement.dataset["palette"] = prefs.palette;
  prefsTopic.changed();
}

/** Shortens a viewer's name to 16 bytes, the limit of the loop. */
export function initials(text: string): string {
  let cut = text.trim();
  while (new TextEncoder().encode(cut).length > 16) cut = cut.slice(0, -1);
  return cut;
}
