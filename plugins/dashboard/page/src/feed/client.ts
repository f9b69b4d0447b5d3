// Source of the displayed data: the program's feed, or the dive in this file.
import { prefs } from "../store/prefs";
import { store } from "../store/store";
import { HEADER_BYTES, SAMPLE_BYTES, frameOf, type Frame } from "./binary";
import { Feed } from "./feed";
import { embedded, entryAt, isLast, readDive, stateAt, type Dive } from "./file";
import type { Command } from "./types";

/** Time span before the displayed time. In a file the cross-section shows its samples: two turns of a slow head. */
const TURNS_MS = 20_000;

let feed: Feed | null = null;
let dive: Dive | null = null;
let entry = 0;

export function start(): void {
  setInterval(() => store.topics.clock.changed(), 200);
  store.link.since_ms = performance.now();
  const file = embedded();
  if (file !== null) {
    void readDive(file, store).then(
      (read) => {
        dive = read;
        seekFile(read.t_s.at(-1) ?? 0);
      },
      (error: unknown) => {
        store.link.phase = "lost";
        store.answered(`the dive in this file can't be read: ${String(error)}`, true);
        store.topics.link.changed();
      },
    );
    return;
  }
  feed = new Feed(store, base());
  feed.start();
  document.addEventListener("visibilitychange", () => feed?.send({ do: "rate", hz: document.hidden || prefs.slow ? 1 : 5 }));
}

/** The program's address. A proxy may serve it below a path. Widgets are one folder deeper. */
const base = (): URL => new URL(location.pathname.includes("/widget/") ? ".." : ".", location.href);

/** Sends a command; returns whether it was sent. */
export function send(command: Command): boolean {
  if (!dive) return feed?.send(command) ?? false;
  store.answered("this page is a file: it accepts no commands", true);
  return false;
}

export const login = (token: string): Promise<string> => feed?.login(token) ?? Promise.resolve("There is no program to log in to.");
export const reconnect = (): void => feed?.again();
export const acknowledge = (alert: number): boolean => send({ do: "acknowledge", alert, by: prefs.by });
export const silence = (): boolean => send({ do: "silence", by: prefs.by });
export const note = (text: string): boolean => send({ do: "note", text, by: prefs.by });
export const beginVoice = (id: number, by: string): boolean => send({ do: "voice", id, by });

/** Sends the recording of a voice note. If the program refuses it, throws the reason. */
export async function sendVoice(id: number, seconds: number, sound: Blob): Promise<void> {
  const url = new URL(`voice/${id}`, base());
  url.searchParams.set("seconds", String(seconds));
  const sent = fetch(url, { method: "POST", body: sound, headers: { "content-type": sound.type }, credentials: "same-origin" });
  const response = await sent.catch(() => { throw new Error("the voice note is not sent: not connected to the program"); });
  if (response.ok) return;
  const answer = (await response.json().catch(() => null)) as { why?: string } | null;
  throw new Error(answer?.why ?? `the program answered ${response.status}`);
}

/** Returns the recording of a voice note, from the program or the file. Throws the reason if it has none. */
export async function voiceOf(id: number): Promise<Blob> {
  if (dive) {
    const sound = dive.voices.get(id);
    if (!sound) throw new Error("its recording isn't in this file");
    return sound;
  }
  const response = await fetch(new URL(`voice/${id}`, base()), { credentials: "same-origin" });
  if (!response.ok) throw new Error((await response.text()).trim());
  return response.blob();
}

/** Displays the dive in the file at a given time. */
export function seekFile(at_s: number): void {
  if (!dive) return;
  entry = entryAt(dive.t_s, at_s);
  const state = stateAt(dive, entry);
  if (!state) return;
  const from_s = dive.t_s[0] ?? 0;
  const upTo_ms = (dive.t_s[entry] ?? 0) * 1000;
  store.turns.clear();
  store.turns.take(chosen(dive, (view, at) => {
    const t_ms = view.getUint32(at, true);
    return t_ms <= upTo_ms && t_ms > upTo_ms - TURNS_MS;
  }));
  store.topics.samples.changed();
  store.end = isLast(dive, entry) ? dive.end : null;
  store.take({ ...state, playback: { paused: true, speed: null, at_s: dive.t_s[entry] ?? 0, from_s, to_s: dive.t_s.at(-1) ?? 0 } });
}

export function stepFile(by: number): void {
  if (dive) seekFile(dive.t_s[Math.min(Math.max(entry + by, 0), dive.t_s.length - 1)] ?? 0);
}

/** Returns the samples between two chainages, from the program or the file, and the thinning step. */
export async function samples(from_m: number, to_m: number, signal: AbortSignal): Promise<{ frame: Frame; oneOf: number }> {
  if (dive) return { frame: fromFile(dive, from_m, to_m), oneOf: store.hello?.thinned ? 2 : 1 };
  const url = new URL("samples", base());
  url.searchParams.set("from_m", from_m.toFixed(2));
  url.searchParams.set("to_m", to_m.toFixed(2));
  const response = await fetch(url, { signal, credentials: "same-origin" });
  if (!response.ok) throw new Error(`samples from ${from_m.toFixed(0)} to ${to_m.toFixed(0)} m: ${response.status}`);
  return { frame: frameOf(await response.arrayBuffer()), oneOf: Number(response.headers.get("headrace-one-of") ?? 1) };
}

function fromFile(dive: Dive, from_m: number, to_m: number): Frame {
  return chosen(dive, (view, at) => {
    const x_m = view.getFloat32(at + 4, true);
    return x_m >= from_m && x_m < to_m;
  });
}

/** Returns the selected samples of a file as a frame. */
function chosen({ samples }: Dive, choose: (view: DataView, at: number) => boolean): Frame {
  const records: Uint8Array[] = [];
  for (const { view, count } of samples) {
    for (let at = 0; at < count * SAMPLE_BYTES; at += SAMPLE_BYTES) {
      if (choose(view, at)) records.push(new Uint8Array(view.buffer, view.byteOffset + at, SAMPLE_BYTES));
    }
  }
  const bytes = new Uint8Array(HEADER_BYTES + records.length * SAMPLE_BYTES);
  const head = new DataView(bytes.buffer);
  head.setUint8(0, 2);
  head.setUint8(1, 1);
  head.setUint32(4, records.length, true);
  records.forEach((record, at) => bytes.set(record, HEADER_BYTES + at * SAMPLE_BYTES));
  return frameOf(bytes.buffer);
}
