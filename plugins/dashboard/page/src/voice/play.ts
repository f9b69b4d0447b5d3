// Plays the recordings of voice notes, one at a time.
import { voiceOf } from "../feed/client";
import { store } from "../store/store";
import { Topic } from "../store/topic";

export const playTopic = new Topic();
/** Id of the note that is playing; null for none. */
export let playing: number | null = null;

let audio: HTMLAudioElement | null = null;

function stop(): void {
  if (audio) {
    audio.pause();
    URL.revokeObjectURL(audio.src);
  }
  audio = null;
  playing = null;
  playTopic.changed();
}

/** Plays a note's recording; a second call stops it. */
export async function togglePlay(id: number, number: number): Promise<void> {
  const again = playing === id;
  stop();
  if (again) return;
  playing = id;
  playTopic.changed();
  try {
    const sound = await voiceOf(id);
    if (playing !== id) return;
    audio = new Audio(URL.createObjectURL(sound));
    audio.onended = stop;
    await audio.play();
  } catch (error) {
    if (playing === id) stop();
    store.answered(`note ${number} can't be played: ${error instanceof Error ? error.message : String(error)}`, true);
  }
}
