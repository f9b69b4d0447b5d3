// Records a voice note. The note is created when the recording begins; the sound is sent when the recording ends.
import { beginVoice, sendVoice } from "../feed/client";
import { prefs } from "../store/prefs";
import { store } from "../store/store";
import { Topic } from "../store/topic";
import { BITS_PER_S, MOST_BYTES, MOST_S, lack, recordable, refusal, seconds } from "./lack";

interface Taken { id: number; seconds: number; sound: Blob; failed_ms: number }

export const voiceTopic = new Topic();
export const voice = {
  phase: "idle" as "idle" | "asking" | "recording" | "sending" | "unsent",
  /** Start of the recording, performance.now(). */
  since_ms: 0,
  /** Message for the operator; empty for none. */
  why: "",
};

let recorder: MediaRecorder | null = null;
let unsent: Taken | null = null;

function become(phase: typeof voice.phase, why = ""): void {
  voice.phase = phase;
  voice.why = why;
  voiceTopic.changed();
}

function type(): string | null {
  return typeof MediaRecorder === "undefined" ? null : recordable((each) => MediaRecorder.isTypeSupported(each));
}

/** Reason why no voice note can be recorded now. */
export function lacks(): string | null {
  return lack({
    connected: store.link.phase === "open" || store.link.phase === "file", operates: store.hello?.may.operate ?? false, recorded: store.state?.recording?.on ?? true,
    secure: isSecureContext, asks: Boolean(navigator.mediaDevices?.getUserMedia), type: type(),
  });
}

/** Takes the next step: begins or ends a recording, or sends one that could not be sent before. */
export function next(): void {
  if (voice.phase === "idle") void begin();
  else if (voice.phase === "recording") end();
  else if (voice.phase === "unsent") void send();
}

async function begin(): Promise<void> {
  const why = lacks(), mimeType = type();
  if (why !== null || mimeType === null) return become("idle", why ?? "");
  become("asking");
  let stream: MediaStream;
  try {
    stream = await navigator.mediaDevices.getUserMedia({ audio: { channelCount: 1, echoCancellation: true, noiseSuppression: true } });
  } catch (error) {
    return become("idle", refusal((error as DOMException).name));
  }
  const id = 1 + (crypto.getRandomValues(new Uint32Array(1))[0] ?? 0) % 0xffff_ffff;
  const parts: Blob[] = [];
  try {
    recorder = new MediaRecorder(stream, { mimeType, audioBitsPerSecond: BITS_PER_S });
    recorder.ondataavailable = (event) => parts.push(event.data);
    recorder.onstop = () => {
      const length_ms = performance.now() - voice.since_ms;
      stream.getTracks().forEach((track) => track.stop());
      recorder = null;
      unsent = { id, seconds: seconds(length_ms), sound: new Blob(parts, { type: mimeType }), failed_ms: 0 };
      void send();
    };
    recorder.start();
  } catch (error) {
    stream.getTracks().forEach((track) => track.stop());
    recorder = null;
    return become("idle", `nothing can be recorded: ${String(error)}`);
  }
  // From here on the note exists with its time and position, even if its sound is lost.
  if (!beginVoice(id, prefs.by)) {
    recorder.onstop = () => stream.getTracks().forEach((track) => track.stop());
    recorder.stop();
    recorder = null;
    return become("idle", "no voice note now: not connected to the program");
  }
  voice.since_ms = performance.now();
  become("recording");
}

function end(): void {
  if (recorder?.state === "recording") recorder.stop();
}

async function send(): Promise<void> {
  const taken = unsent;
  if (!taken) return become("idle");
  if (taken.sound.size > MOST_BYTES) {
    unsent = null;
    return become("idle", `the recording has ${Math.ceil(taken.sound.size / 1024)} kB; at most 512 kB are accepted. The note remains as a mark`);
  }
  become("sending");
  try {
    await sendVoice(taken.id, taken.seconds, taken.sound);
  } catch (error) {
    taken.failed_ms = performance.now();
    return become("unsent", error instanceof Error ? error.message : String(error));
  }
  unsent = null;
  become("idle");
  store.answered(`voice note of ${taken.seconds} s saved`, false);
}

/** Drops a recording that couldn't be sent; the note remains as a mark. */
export function discard(): void {
  unsent = null;
  become("idle");
}

export function startVoice(): void {
  store.topics.clock.on(() => {
    if (voice.phase === "recording") {
      if (performance.now() - voice.since_ms >= MOST_S * 1000) end();
      voiceTopic.changed();
    }
  });
  // A recording that a lost connection held back is sent as soon as the connection returns.
  store.topics.link.on(() => {
    if (unsent && voice.phase === "unsent" && store.link.phase === "open" && store.link.since_ms > unsent.failed_ms) void send();
  });
  addEventListener("beforeunload", (event) => { if (voice.phase !== "idle" && voice.phase !== "asking") event.preventDefault(); });
}
