// Text and voice notes, each at a position. The key N writes a note at the present position, T records one.
import { useEffect, useRef } from "preact/hooks";
import { note } from "../feed/client";
import { store } from "../store/store";
import type { Note } from "../feed/types";
import { useTopics } from "../store/topic";
import { station } from "../text/format";
import { NOTES } from "../text/table";
import { Time } from "../ui/Time";
import { playTopic, playing, togglePlay } from "../voice/play";
import { VoiceButton, VoiceWords } from "../voice/Voice";
import { actions } from "../wall/control";

const MOST_BYTES = 240;
let show: (() => void) | null = null;

/** Focuses the field at once, so that typed text goes into it. */
export function openNote(): void {
  show?.();
}

/** Text of a note, the same as on the terminal. */
export function words({ text, voice }: Note): string {
  if (voice) return voice.seconds === null ? NOTES.voice : `${NOTES.voice}, ${voice.seconds} s`;
  return text || NOTES.mark;
}

export function Notes() {
  useTopics(store.topics.notes, store.topics.hello, playTopic);
  return (
    <section class="panel notes" aria-label="Notes">
      <div class="panel-head"><h2>Notes</h2><span class="buttons"><VoiceButton /><button type="button" disabled={!(store.hello?.may.operate ?? false)} onClick={openNote} title="Note at this place (N)">Note…</button></span></div>
      <VoiceWords />
      <ol tabIndex={0} aria-label="Notes, newest first">
        {[...store.notes].reverse().map((each) => (
          <li key={each.number}>
            <button type="button" class="leg" disabled={each.chainage_m === null} onClick={() => each.chainage_m !== null && actions.goTo(each.chainage_m, 30)}>
              {each.chainage_m === null ? null : <b>{station(each.chainage_m)}</b>} {words(each)} <span class="leg-why">{each.by} <Time at_s={each.at_s} /></span>
            </button>
            {each.voice && each.voice.seconds !== null ? <Play number={each.number} id={each.voice.id} seconds={each.voice.seconds} /> : null}
          </li>
        ))}
        {store.notes.length === 0 ? <li class="none">none yet</li> : null}
      </ol>
    </section>
  );
}

function Play({ number, id, seconds }: { number: number; id: number; seconds: number }) {
  const now = playing === id;
  return (
    <button type="button" class="play" aria-pressed={now} aria-label={`${now ? "Stop" : "Play"} note ${number}, ${seconds} s`} onClick={() => void togglePlay(id, number)}>
      {now ? "■" : "▶"}
    </button>
  );
}

export function NoteDialog() {
  useTopics(store.topics.state);
  const dialog = useRef<HTMLDialogElement>(null), field = useRef<HTMLInputElement>(null);
  useEffect(() => {
    show = () => {
      if (!dialog.current?.open) dialog.current?.showModal();
      field.current?.focus();
    };
    return () => { show = null; };
  }, []);
  const close = () => dialog.current?.close();
  const submit = (event: Event) => {
    event.preventDefault();
    let text = field.current?.value.trim() ?? "";
    while (new TextEncoder().encode(text).length > MOST_BYTES) text = text.slice(0, -1);
    note(text);
    if (field.current) field.current.value = "";
    close();
  };
  const at = store.state?.position.chainage_m;
  return (
    <dialog ref={dialog} class="note" aria-label="Note">
      <form onSubmit={submit}>
        <label>Note at {at === null || at === undefined ? "this time" : station(at)}
          <input ref={field} type="text" maxLength={MOST_BYTES} autocomplete="off" />
        </label>
        <span class="buttons"><button type="submit">Save (Enter)</button><VoiceButton /><button type="button" onClick={close}>Cancel (Esc)</button></span>
        <VoiceWords />
      </form>
    </dialog>
  );
}
