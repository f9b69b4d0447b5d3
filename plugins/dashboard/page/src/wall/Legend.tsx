// Legend for the wall's colours and marks.
import { store } from "../store/store";
import { useTopics } from "../store/topic";
import { figure } from "../text/format";
import { UNSEEN, VERDICTS } from "../text/table";

/** Colours of the largest hole, from 0 to twice the target. */
export function Scale() {
  useTopics(store.topics.hello);
  const target = store.hello?.target_m ?? null;
  const compared = store.hello?.compared_m;
  return (
    <span class="legend">
      <span class="scale" aria-hidden="true" />
      <span>hole 0 · <b>T {compared === undefined ? `${figure(target, 2)} m` : `${figure(target, 2)} or ${figure(compared, 2)} m`}</b> · 2 T</span>
    </span>
  );
}

/** Marks on the wall: the class of each swatch, its name, and its meaning. */
const MARKS: [string, string, string][] = [
  ["flagged", VERDICTS.fail, "outline, and triangle with the alert's number: missed sections"],
  ["gap", "gap", "missed place between the samples of a judged section"],
  ["hatched", VERDICTS.cannot_say, "position or returns too uncertain"],
  ["grey-hatched", VERDICTS.not_inspected, "some heads have not passed"],
  ["dim", VERDICTS.open, "dim colours: driving on may still fill the hole"],
  ["blank", UNSEEN, "no data"],
  ["sample", "sample", "dot: a return; zoom in to see it as a disc whose diameter is the target"],
  ["ring", "doubtful", "a return that does not count"],
  ["curve", "this turn", "moving curve: where a head's present turn meets the wall"],
  ["circle", "largest hole", "circle as large as the hole"],
  ["vehicle", "vehicle", "the vehicle, its direction, and the 95 % range of its position"],
];

export function Legend() {
  return <ul class="legend marks" aria-label="Marks on the wall">{MARKS.map(([mark, name, meaning]) => <li key={mark} class={`mark ${mark}`} title={meaning}>{name}</li>)}</ul>;
}
