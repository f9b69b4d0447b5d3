// The status line at the bottom: dive, connection, answers to commands, palette and keys.
import { PALETTES, prefs, prefsTopic, setPrefs } from "../store/prefs";
import { hasEnded, lost_s } from "../store/age";
import { store } from "../store/store";
import { useTopics } from "../store/topic";
import { span } from "../text/format";
import { setHelp } from "../keys/keys";

const ANSWER_MS = 6000;

export function Status() {
  useTopics(store.topics.hello, store.topics.link, store.topics.answer, store.topics.told, store.topics.clock, prefsTopic);
  const { hello, link, answer } = store;
  const lost = lost_s(store), closed = link.phase === "lost" && hasEnded(store);
  const fresh = answer && performance.now() - answer.at_ms < ANSWER_MS ? answer : null;
  const told = store.told.at(-1);
  const words = { open: "connected", file: "recorded dive in a file", connecting: "connecting", refused: "no access", lost: `no connection for ${span(lost ?? 0)}, tried ${link.tries} times` }[link.phase];
  return (
    <footer class="status">
      <span class={`link ${closed ? "closed" : link.phase}`}>{closed ? "the program has closed" : words}</span>
      <span class="dive">{hello ? `${hello.dive} · ${hello.vehicle} · ${hello.mode}` : ""}{hello?.thinned ? ` · ${hello.thinned.toLocaleString("en")} samples left out` : ""}</span>
      <span class={`said${fresh?.refused ? " refused" : ""}`} role="status">{fresh ? (fresh.refused ? `refused: ${fresh.text}` : fresh.text) : ""}</span>
      <span class="told" title={told?.text}>{told?.text ?? ""}</span>
      <span class="palettes" role="group" aria-label="Palette">
        {PALETTES.map((palette) => <button type="button" key={palette} aria-pressed={prefs.palette === palette} onClick={() => setPrefs({ palette })}>{palette}</button>)}
      </span>
      <button type="button" onClick={() => setHelp(true)} title="Keys (?)">? keys</button>
    </footer>
  );
}
