// Sounds of alerts by WebAudio.
// Emergency alarm: high and low tones without a pause. Alarm: three short high tones every 4 s. Warning: two long low
// tones every 12 s.
// Silenced and muted alerts make no sound. The loop decides which other alerts sound.
import type { Alert, Priority } from "../feed/types";
import { isOld } from "../store/age";
import { isUnacknowledged } from "../store/alerts";
import { prefs } from "../store/prefs";
import { store } from "../store/store";
import { Topic } from "../store/topic";

interface Note { at_s: number; for_s: number; hz: number; shape: OscillatorType }

const PATTERNS: Record<Exclude<Priority, "caution">, { every_s: number; notes: Note[] }> = {
  emergency_alarm: { every_s: 1, notes: [{ at_s: 0, for_s: 0.45, hz: 990, shape: "square" }, { at_s: 0.5, for_s: 0.45, hz: 660, shape: "square" }] },
  alarm: { every_s: 4, notes: [0, 0.22, 0.44].map((at_s) => ({ at_s, for_s: 0.14, hz: 990, shape: "square" as const })) },
  warning: { every_s: 12, notes: [0, 0.6].map((at_s) => ({ at_s, for_s: 0.45, hz: 392, shape: "sine" as const })) },
};
const LEVEL = 0.12;

export const soundTopic = new Topic();
let context: AudioContext | null = null;
let next_s = 0;
let playing: Priority | null = null;

/** Whether the browser allows sound, which it does only after a user action. */
export const isAudible = (): boolean => context?.state === "running";

/** Enables sound. Browsers allow this only in the handler of a click or key. */
export function unlock(): void {
  try {
    context ??= new AudioContext();
  } catch {
    return;
  }
  void context.resume().then(() => soundTopic.changed());
}

/** Priority of the alert that sounds now; null if none sounds. */
export function sounding(alerts: Iterable<Alert>, muted: readonly string[]): Exclude<Priority, "caution"> | null {
  const found = new Set<Priority>();
  for (const alert of alerts) {
    const heard = alert.sounds && alert.state === "active" && isUnacknowledged(alert) && !muted.includes(alert.class);
    if (heard) found.add(alert.priority);
  }
  return (["emergency_alarm", "alarm", "warning"] as const).find((priority) => found.has(priority)) ?? null;
}

function beat(): void {
  // Old data is still displayed but makes no sound, because it may no longer be true.
  const now = prefs.sound && store.link.phase !== "file" && !isOld(store) ? sounding(store.alerts.values(), prefs.muted) : null;
  if (now !== playing) {
    playing = now;
    next_s = 0;
    soundTopic.changed();
  }
  if (!now || !context || context.state !== "running" || context.currentTime < next_s) return;
  const { every_s, notes } = PATTERNS[now];
  for (const note of notes) play(context, note);
  next_s = context.currentTime + every_s;
}

function play(audio: AudioContext, { at_s, for_s, hz, shape }: Note): void {
  const tone = audio.createOscillator(), gain = audio.createGain(), from = audio.currentTime + 0.02 + at_s;
  tone.type = shape;
  tone.frequency.value = hz;
  gain.gain.setValueAtTime(0, from);
  gain.gain.linearRampToValueAtTime(LEVEL, from + 0.015);
  gain.gain.setValueAtTime(LEVEL, from + for_s - 0.03);
  gain.gain.linearRampToValueAtTime(0, from + for_s);
  tone.connect(gain).connect(audio.destination);
  tone.start(from);
  tone.stop(from + for_s + 0.05);
}

export function startSound(): void {
  setInterval(beat, 100);
  const first = () => {
    unlock();
    removeEventListener("pointerdown", first);
    removeEventListener("keydown", first);
  };
  addEventListener("pointerdown", first);
  addEventListener("keydown", first);
}
