// Legend for the wall's colours and marks.
import { store } from "../store/store";
import { useTopics } from "../store/topic";
import { figure } from "../text/format";
import { UNSEEN, VERDICTS } from "../text/table";

export function Legend() {
  useTopics(store.topics.hello);
  const target = store.hello?.target_m ?? null;
  const compared = store.hello?.compared_m;
  return (
    <span class="legend">
      <span class="scale" aria-hidden="true" />
      <span>hole 0 · <b>T {compared === undefined ? `${figure(target, 2)} m` : `${figure(target, 2)} or ${figure(compared, 2)} m`}</b> · 2 T</span>
      <span class="mark flagged">{VERDICTS.fail}</span>
      <span class="mark hatched">{VERDICTS.cannot_say}</span>
      <span class="mark blank">{UNSEEN}</span>
    </span>
  );
}
