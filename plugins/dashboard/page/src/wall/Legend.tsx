// Legend for the wall's colours and marks.
import { store } from "../store/store";
import { useTopics } from "../store/topic";
import { figure } from "../text/format";

export function Legend() {
  useTopics(store.topics.hello);
  const target = store.hello?.target_m ?? null;
  const compared = store.hello?.compared_m;
  return (
    <span class="legend">
      <span class="scale" aria-hidden="true" />
      <span>hole 0 · <b>T {compared === undefined ? `${figure(target, 2)} m` : `${figure(target, 2)} or ${figure(compared, 2)} m`}</b> · 2 T</span>
      <span class="mark flagged">missed</span>
      <span class="mark hatched">can't say</span>
      <span class="mark blank">unseen</span>
    </span>
  );
}
