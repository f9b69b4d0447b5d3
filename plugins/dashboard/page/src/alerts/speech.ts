// Speaks alerts if the viewer has enabled speech. A new alert interrupts the speech of an older one. Nothing is
// repeated.
import { prefs, prefsTopic } from "../store/prefs";
import { isUnacknowledged } from "../store/alerts";
import { store } from "../store/store";

let spoken: number | null = null;

function hush(): void {
  spoken = null;
  speechSynthesis.cancel();
}

/** Stations as spoken: "1+240" is "1 plus 2 4 0". */
export function sayable(text: string): string {
  return text.replace(/(\d+)\+(\d{3})(\.\d+)?/g, (_, kilometres: string, metres: string) => `${kilometres} plus ${metres.split("").join(" ")}`).toLowerCase();
}

export function startSpeech(): void {
  if (!("speechSynthesis" in window)) return;
  store.onAlert((alert, change) => {
    if (alert.number === spoken && (alert.state !== "active" || !isUnacknowledged(alert))) hush();
    const heard = change === "raised" && prefs.speech && alert.priority !== "caution" && !prefs.muted.includes(alert.class);
    if (!heard) return;
    hush();
    const words = new SpeechSynthesisUtterance(sayable(`${alert.text}. ${alert.advice ?? ""}`));
    words.lang = "en";
    spoken = alert.number;
    words.onend = () => { if (spoken === alert.number) spoken = null; };
    speechSynthesis.speak(words);
  });
  prefsTopic.on(() => { if (!prefs.speech && spoken !== null) hush(); });
}
