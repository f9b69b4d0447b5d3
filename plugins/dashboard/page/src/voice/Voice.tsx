// The button that records a voice note, and its messages.
import { store } from "../store/store";
import { useTopics } from "../store/topic";
import { clock } from "../text/format";
import { MOST_S } from "./lack";
import { discard, lacks, next, voice, voiceTopic } from "./record";

/** A recording whose button is held longer than this ends on release. The times of press and release are those of the
 * input events, because a busy page handles the events late. */
const HELD_MS = 700;
let down_ms: number | null = null;

function press(event: PointerEvent): void {
  if (event.button !== 0) return;
  down_ms = voice.phase === "idle" ? event.timeStamp : null;
  next();
}

function release(event: PointerEvent): void {
  if (down_ms !== null && voice.phase === "recording" && event.timeStamp - down_ms > HELD_MS) next();
  down_ms = null;
}

export function VoiceButton() {
  useTopics(voiceTopic, store.topics.hello, store.topics.link);
  const { phase } = voice;
  const lack = phase === "idle" ? lacks() : null;
  const past_s = (performance.now() - voice.since_ms) / 1000;
  const words = {
    // The button stays enabled, because a click displays the reason.
    idle: lack === null ? "Voice" : "No voice", asking: "microphone…", recording: `End ${clock(past_s)}`, sending: "sending…", unsent: "Send again",
  }[phase];
  const title = lack ?? (phase === "idle" ? "Voice note at this place: tap, speak, tap; or hold (T)" : phase === "recording" ? `${words} of ${clock(MOST_S)} (T)` : words);
  return (
    <button type="button" class={`voice ${phase}${lack === null ? "" : " lacks"}`} aria-pressed={phase === "recording"} title={title}
      onPointerDown={press} onPointerUp={release} onPointerCancel={release}
      onContextMenu={(event) => event.preventDefault()} onClick={(event) => { if (event.detail === 0) next(); }}>
      <svg viewBox="0 0 16 16" aria-hidden="true">
        {phase === "recording" ? <rect x="3" y="3" width="10" height="10" /> : <path d="M8 1a2.4 2.4 0 0 0-2.4 2.4v4a2.4 2.4 0 0 0 4.8 0v-4A2.4 2.4 0 0 0 8 1zM3.5 7a4.5 4.5 0 0 0 3.8 4.6V15h1.4v-3.4A4.5 4.5 0 0 0 12.5 7h-1.3a3.2 3.2 0 0 1-6.4 0z" />}
      </svg>
      {words}{phase === "recording" ? <span class="of">of {clock(MOST_S)}</span> : null}
    </button>
  );
}

export function VoiceWords() {
  useTopics(voiceTopic);
  return (
    <p class="voice-words" role="status">
      {voice.phase === "unsent" ? <button type="button" onClick={discard}>Discard</button> : null}
      {voice.why}
    </p>
  );
}
