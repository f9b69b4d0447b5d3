// Reads a dive that is embedded in the page's own file: base64 of frames that are compressed with deflate-raw. A frame
// is u32 length, u8 kind (0 text, 1 binary), bytes.
import type { Store } from "../store/store";
import { frameOf, KIND_SAMPLES, type Frame } from "./binary";
import type { End, Message, State } from "./types";

export interface Dive { samples: Frame[]; t_s: number[]; states: Partial<State>[]; voices: Map<number, Blob>; end: End; last: Partial<State> }

export function embedded(): string | null {
  return document.getElementById("dive")?.textContent?.trim() ?? null;
}

function bytesOf(base64: string): Uint8Array<ArrayBuffer> {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let at = 0; at < text.length; at += 1) bytes[at] = text.charCodeAt(at);
  return bytes;
}

async function inflate(base64: string): Promise<ArrayBuffer> {
  const stream = new Blob([bytesOf(base64)]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Response(stream).arrayBuffer();
}

/** Splits the bytes into frames. */
export function* frames(bytes: ArrayBuffer): Generator<string | Frame> {
  const view = new DataView(bytes);
  const text = new TextDecoder();
  let at = 0;
  while (at < bytes.byteLength) {
    if (at + 5 > bytes.byteLength) throw new Error(`the dive ends within a frame's header, at byte ${at}`);
    const length = view.getUint32(at, true), kind = view.getUint8(at + 4);
    if (at + 5 + length > bytes.byteLength) throw new Error(`the dive ends within a frame, at byte ${at}`);
    if (kind === 0) yield text.decode(new Uint8Array(bytes, at + 5, length));
    else yield frameOf(bytes.slice(at + 5, at + 5 + length));
    at += 5 + length;
  }
}

/** Reads the embedded dive into the store. */
export async function readDive(base64: string, store: Store): Promise<Dive> {
  const dive: Dive = { samples: [], t_s: [], states: [], voices: new Map(), end: {}, last: {} };
  store.link.phase = "file";
  for (const frame of frames(await inflate(base64))) {
    if (typeof frame !== "string") {
      if (frame.kind === KIND_SAMPLES) dive.samples.push(frame);
      else store.takeFrame(frame);
      continue;
    }
    const message = JSON.parse(frame) as Message;
    if (message.type === "timeline") {
      const { t_s, states } = message as { t_s: number[]; states: Partial<State>[] };
      dive.t_s = t_s;
      dive.states = states;
    } else if (message.type === "voice") {
      const { id, media_type, audio } = message as { id: number; media_type: string; audio: string };
      dive.voices.set(id, new Blob([bytesOf(audio)], { type: media_type }));
    } else {
      store.take(message);
    }
  }
  dive.end = store.end ?? {};
  dive.last = store.state ?? {};
  store.ready = true;
  return dive;
}

/** Whether an entry of the timeline is the last one, at which the dive has ended. */
export function isLast({ states }: Dive, entry: number): boolean {
  return entry >= states.length - 1;
}

/** State at an entry of the timeline. A later entry has only the fields that differ from the first. The last one shows the end of the dive. */
export function stateAt(dive: Dive, entry: number): State | null {
  const whole: Partial<State> = {};
  const first = dive.states[0];
  if (!first) return null;
  Object.assign(whole, first, dive.states[entry], isLast(dive, entry) ? dive.last : {});
  return { ...EMPTY, ...whole, type: "state" } as State;
}

const EMPTY: Omit<State, "type"> = {
  t_s: 0, text: "", now_s: 0, at_s: null, age_s: 0, old: false, condition: "no_data", lamp: "amber",
  position: {
    state: "none", why: null, chainage_m: null, station: null, chainage_sd_m: null, place_sd_m: null, yaw_sd_deg: null, pass_sd_m: null, stand_s: 0,
  },
  speed_mps: null, v_max_mps: null, reason: null, margins: { speed_mps: null, turn_m: null, position_m: null, lost_share: null }, turn: null,
  sensors: [], metres: { pass_m: 0, fail_m: 0, cannot_say_m: 0, open_m: 0, not_inspected_m: 0, way_m: 0 }, cannot_say: null,
};

/** Finds the last entry of the timeline at or before a time. */
export function entryAt(t_s: number[], at_s: number): number {
  let low = 0, high = t_s.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if ((t_s[middle] ?? 0) <= at_s) low = middle;
    else high = middle - 1;
  }
  return low;
}
