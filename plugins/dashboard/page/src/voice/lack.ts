// Texts for the reasons why no voice note can be recorded, and limits of recordings.

/** Limits of a recording, the same as in the loop and the log. */
export const MOST_S = 60;
export const MOST_BYTES = 512 * 1024;
/** Bit rate at which speech in Opus is clear. A minute takes 180 kB. */
export const BITS_PER_S = 24_000;
const TYPES = ["audio/webm;codecs=opus", "audio/ogg;codecs=opus", "audio/mp4"];

export interface Here {
  connected: boolean; operates: boolean; recorded: boolean;
  /** Whether the browser considers the page a secure context. */
  secure: boolean;
  /** Whether the browser can ask for a microphone. */
  asks: boolean;
  type: string | null;
}

/** Reason why no voice note can be recorded; null if one can be. */
export function lack(here: Here): string | null {
  if (!here.connected) return "no voice note now: not connected to the program";
  if (!here.operates) return "no voice notes: the dive doesn't accept them, or the token is for viewing only";
  if (!here.recorded) return "no voice notes: this dive isn't recorded";
  if (!here.secure) return "no voice notes: browsers allow the microphone only for https pages and for pages of this machine (127.0.0.1)";
  if (!here.asks || here.type === null) return "no voice notes: this browser can't record sound";
  return null;
}

/** First type that the browser can record and the log accepts. */
export function recordable(supports: (type: string) => boolean): string | null {
  return TYPES.find(supports) ?? null;
}

/** Reason why the browser gave no microphone. */
export function refusal(name: string): string {
  if (name === "NotAllowedError" || name === "SecurityError") return "the microphone was refused: allow it for this page in the browser";
  if (name === "NotFoundError" || name === "OverconstrainedError") return "there is no microphone";
  if (name === "NotReadableError") return "another program is using the microphone";
  return `the microphone can't be opened: ${name}`;
}

/** Duration of a recording in whole seconds, as displayed in the note. */
export const seconds = (ms: number): number => Math.min(MOST_S, Math.max(1, Math.round(ms / 1000)));
