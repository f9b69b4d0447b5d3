import { useEffect, useRef } from "preact/hooks";
import { initials, prefs, prefsTopic, setPrefs } from "../store/prefs";
import { useTopics } from "../store/topic";
import { helpOpen, helpTopic, KEYS, setHelp } from "./keys";

export function Help() {
  useTopics(helpTopic, prefsTopic);
  const dialog = useRef<HTMLDialogElement>(null);
  useEffect(() => {
    const its = dialog.current;
    if (!its || its.open === helpOpen) return;
    if (helpOpen) its.showModal();
    else its.close();
  });
  return (
    <dialog ref={dialog} class="help" aria-label="Keys" onClose={() => setHelp(false)}>
      <div class="help-head"><h2>Keys</h2><button type="button" onClick={() => setHelp(false)}>Close (Esc)</button></div>
      <label>Your initials, stored with your acknowledgements and notes <input type="text" value={prefs.by} onChange={(event) => setPrefs({ by: initials(event.currentTarget.value) || "page" })} /></label>
      <div class="help-groups">
        {[...new Set(KEYS.map((key) => key.group))].map((group) => (
          <div key={group}>
            <h3>{group}</h3>
            <dl>{KEYS.filter((key) => key.group === group).map((key) => <div key={key.shown}><dt><kbd>{key.shown}</kbd></dt><dd>{key.what}</dd></div>)}</dl>
          </div>
        ))}
      </div>
      <p>On the wall: wheel or pinch zooms, dragging moves, Shift and wheel zooms clock positions.</p>
    </dialog>
  );
}
