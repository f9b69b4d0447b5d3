// Why no voice can be recorded here, in words, and what may be.

/** As the loop and the log take them. */
export const MOST_S = 60;
export const MOST_BYTES = 512 * 1024;
/** Speech in Opus is clear at this; a minute has 180 kB. */
export const BITS_PER_S = 24_000;
const TYPES = ["audio/webm;codecs=opus", "audio/ogg;codecs=opus", "audio/mp4"];

export interface Here {
  connected: boolean; operates: boolean; recorded: boolean;
  /** What browsers call a secure context. */
  secure: boolean;
  /** Whether there is anything to ask for a microphone. */
  asks: boolean;
  type: string | null;
}

/** Why not; null where it can be. */
export function lack(here: Here): string | null {
  if (!here.connected) return "no voice now: no connection to the program";
  if (!here.operates) return "no voice here: this dive takes none, or the token is a viewer's";
  if (!here.recorded) return "no voice here: this dive isn't recorded";
  if (!here.secure) return "no voice here: browsers give the microphone to pages by https, or of this machine (127.0.0.1), alone";
  if (!here.asks || here.type === null) return "no voice here: this browser records no sound";
  return null;
}

/** The first type that the browser records and the log takes. */
export function recordable(supports: (type: string) => boolean): string | null {
  return TYPES.find(supports) ?? null;
}

/** Why the browser gave no microphone. */
export function refusal(name: string): string {
  if (name === "NotAllowedError" || name === "SecurityError") return "the microphone was refused: allow it for this page in the browser";
  if (name === "NotFoundError" || name === "OverconstrainedError") return "there is no microphone";
  if (name === "NotReadableError") return "the microphone is taken by another program";
  return `the microphone can't be had: ${name}`;
}

/** Whole seconds of a recording, as the note says them. */
export const seconds = (ms: number): number => Math.min(MOST_S, Math.max(1, Math.round(ms / 1000)));
