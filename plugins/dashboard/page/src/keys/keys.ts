// Keys of all actions. The key `?` lists them.
import { acknowledge, note, reconnect, silence } from "../feed/client";
import { toggleSound } from "../alerts/SoundButtons";
import { play } from "../replay/Replay";
import { isUnacknowledged, sorted } from "../store/alerts";
import { PALETTES, prefs, setPrefs } from "../store/prefs";
import { store } from "../store/store";
import { Topic } from "../store/topic";
import { openNote } from "../side/Notes";
import { next as voiceNext } from "../voice/record";
import { actions } from "../wall/control";

export interface Key { keys: string[]; shown: string; what: string; group: string; run: () => void }

export const helpTopic = new Topic();
export let helpOpen = false;
export function setHelp(open: boolean): void {
  helpOpen = open;
  helpTopic.changed();
}

function acknowledgeFirst(): void {
  const first = sorted(store.alerts.values()).find(isUnacknowledged);
  if (first) acknowledge(first.number);
}

/** Shows the next missed place on the wall. */
function nextMissed(): void {
  const missed = sorted(store.alerts.values()).filter((alert) => alert.from_m !== null);
  const at = missed.findIndex((alert) => alert.number === shownAlert);
  const next = missed[(at + 1) % Math.max(1, missed.length)];
  if (!next || next.from_m === null) return;
  shownAlert = next.number;
  actions.goTo((next.from_m + (next.to_m ?? next.from_m)) / 2, 30);
}
let shownAlert = -1;

function nextPalette(): void {
  setPrefs({ palette: PALETTES[(PALETTES.indexOf(prefs.palette) + 1) % PALETTES.length] ?? "day" });
}

export const KEYS: Key[] = [
  { group: "Alerts", keys: ["a"], shown: "A", what: "acknowledge the first alert", run: acknowledgeFirst },
  { group: "Alerts", keys: ["A"], shown: "Shift+A", what: "acknowledge all", run: () => acknowledge(0) },
  { group: "Alerts", keys: ["s"], shown: "S", what: "silence for 30 s", run: silence },
  { group: "Alerts", keys: ["m"], shown: "M", what: "sound on or off", run: toggleSound },
  { group: "Alerts", keys: ["v"], shown: "V", what: "speech on or off", run: () => setPrefs({ speech: !prefs.speech }) },
  { group: "Alerts", keys: ["g"], shown: "G", what: "show the next missed place on the wall", run: nextMissed },
  { group: "Notes", keys: ["n"], shown: "N", what: "write a note at this place", run: openNote },
  { group: "Notes", keys: ["b"], shown: "B", what: "mark this place without words", run: () => note("") },
  { group: "Notes", keys: ["t"], shown: "T", what: "start or end a voice note at this place", run: voiceNext },
  { group: "Wall", keys: ["+", "="], shown: "+", what: "zoom in", run: () => actions.zoom(0.7) },
  { group: "Wall", keys: ["-", "_"], shown: "−", what: "zoom out", run: () => actions.zoom(1 / 0.7) },
  { group: "Wall", keys: ["ArrowLeft"], shown: "←", what: "towards the portal", run: () => actions.pan(-0.1) },
  { group: "Wall", keys: ["ArrowRight"], shown: "→", what: "inwards", run: () => actions.pan(0.1) },
  { group: "Wall", keys: ["ArrowUp"], shown: "↑", what: "around the wall, if zoomed in on clock positions", run: () => actions.down(-0.1) },
  { group: "Wall", keys: ["ArrowDown"], shown: "↓", what: "around the wall, in the other direction", run: () => actions.down(0.1) },
  { group: "Wall", keys: ["]"], shown: "]", what: "zoom in on clock positions", run: () => actions.zoomDown(1.5) },
  { group: "Wall", keys: ["["], shown: "[", what: "zoom out to all clock positions", run: () => actions.zoomDown(1 / 1.5) },
  { group: "Wall", keys: ["f"], shown: "F", what: "follow the vehicle", run: actions.follow },
  { group: "Wall", keys: ["0"], shown: "0", what: "whole tunnel", run: actions.whole },
  { group: "Replay", keys: [" "], shown: "Space", what: "pause or continue", run: play.toggle },
  { group: "Replay", keys: ["."], shown: ".", what: "step", run: play.step },
  { group: "Replay", keys: [","], shown: ",", what: "step by a section", run: play.section },
  { group: "Replay", keys: ["j"], shown: "J", what: "10 s back", run: () => play.by(-10) },
  { group: "Replay", keys: ["l"], shown: "L", what: "10 s forward", run: () => play.by(10) },
  { group: "Replay", keys: ["<"], shown: "<", what: "slower", run: () => play.speed(-1) },
  { group: "Replay", keys: [">"], shown: ">", what: "faster", run: () => play.speed(1) },
  { group: "Replay", keys: ["e"], shown: "E", what: "to the end", run: play.end },
  { group: "Page", keys: ["p"], shown: "P", what: "palette: day, dusk, night", run: nextPalette },
  { group: "Page", keys: ["r"], shown: "R", what: "reconnect now", run: reconnect },
  { group: "Page", keys: ["?"], shown: "?", what: "list of keys", run: () => setHelp(!helpOpen) },
];

export function startKeys(): void {
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
    const target = event.target as HTMLElement;
    const typing = /^(TEXTAREA|SELECT)$/.test(target.tagName) || (target.tagName === "INPUT" && !/^(checkbox|button)$/.test((target as HTMLInputElement).type));
    if (typing || document.querySelector("dialog[open]:not(.help)")) return;
    // A focused button keeps Space and Enter, and a focused list keeps the arrow keys that scroll it.
    if ((event.key === " " || event.key === "Enter") && /^(BUTTON|SUMMARY|INPUT|A)$/.test(target.tagName)) return;
    if (/^Arrow(Up|Down)$/.test(event.key) && target.tagName === "OL") return;
    const key = KEYS.find(({ keys }) => keys.includes(event.key)) ?? KEYS.find(({ keys }) => event.key.length === 1 && keys.includes(event.key.toLowerCase()) && event.key !== "A");
    if (!key || (event.repeat && key.group !== "Wall")) return;
    event.preventDefault();
    key.run();
  });
}
