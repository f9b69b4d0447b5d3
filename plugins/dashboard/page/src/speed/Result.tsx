// The result of a finished dive, in the place of the speed: lengths by verdict and the missed stretches.
import { metresOf, outstandingOf } from "../store/age";
import { store } from "../store/store";
import { useTopics } from "../store/topic";
import { metres, station, stretch } from "../text/format";
import { VERDICTS } from "../text/table";
import { plain } from "../text/words";

const ORDER = ["pass", "fail", "cannot_say", "not_inspected", "open"] as const;

export function Result() {
  useTopics(store.topics.state, store.topics.back);
  const sums = metresOf(store), outstanding = outstandingOf(store), { legs } = store.back;
  return (
    <section class="result" aria-label="Result of the dive">
      <dl>
        {ORDER.filter((key) => key !== "open" || (sums?.open_m ?? 0) > 0).map((key) => (
          <div key={key} class={`${key}${key === "fail" && (sums?.fail_m ?? 0) > 0 ? " bad" : ""}`}><dt>{VERDICTS[key]}</dt><dd>{sums ? metres(sums[`${key}_m`]) : "–"}</dd></div>
        ))}
      </dl>
      {outstanding === null ? null : <p class="outstanding">{outstanding}</p>}
      {legs.length === 0 ? null : (
        <ul tabIndex={0} aria-label="Missed stretches">
          {legs.map(({ from_m, to_m, why }) => <li key={from_m} title={`${station(from_m, 2)}–${station(to_m, 2)}`}><b>{stretch(from_m, to_m)}</b> {plain(why)}</li>)}
        </ul>
      )}
    </section>
  );
}
