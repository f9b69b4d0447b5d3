// Buttons that switch sound and speech on and off, and mute classes of alerts.
import { prefs, prefsTopic, setPrefs } from "../store/prefs";
import { useTopics } from "../store/topic";
import { CLASSES } from "../text/table";
import { isAudible, soundTopic, unlock } from "./sound";

export function toggleSound(): void {
  unlock();
  setPrefs({ sound: !(prefs.sound && isAudible()) });
}

export function SoundButtons() {
  useTopics(prefsTopic, soundTopic);
  const word = !prefs.sound ? "Sound off" : isAudible() ? "Sound on" : "Tap to enable sound";
  const title = prefs.sound && !isAudible() ? "The browser plays no sound until you tap the page" : "Sound (M)";
  return (
    <>
      <button type="button" class={prefs.sound && !isAudible() ? "wants" : ""} aria-pressed={prefs.sound} onClick={toggleSound} title={title}>{word}</button>
      <details class="mutes">
        <summary title="Which alerts sound, and speech">Mute</summary>
        <div class="mutes-box">
          {CLASSES.map((each) => (
            <label key={each}>
              <input type="checkbox" checked={prefs.muted.includes(each)}
                onChange={(event) => setPrefs({ muted: event.currentTarget.checked ? [...prefs.muted, each] : prefs.muted.filter((other) => other !== each) })} /> mute {each}
            </label>
          ))}
          <label><input type="checkbox" checked={prefs.speech} onChange={(event) => setPrefs({ speech: event.currentTarget.checked })} /> speak alerts (V)</label>
        </div>
      </details>
    </>
  );
}
