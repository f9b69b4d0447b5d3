// Lengths by verdict, the remaining length, and directions for going back to missed stretches.
import type { Step } from "../feed/types";
import { hasEnded, metresOf } from "../store/age";
import { store } from "../store/store";
import { useTopics } from "../store/topic";
import { figure, metres, span, speedDown, station, stretch } from "../text/format";
import { VERDICTS } from "../text/table";
import { plain } from "../text/words";
import { actions } from "../wall/control";

const ORDER = ["pass", "fail", "cannot_say", "not_inspected", "open"] as const;

export function Metres() {
  useTopics(store.topics.state);
  const all = metresOf(store);
  const whole = Math.max(all?.way_m ?? 0, 1e-9);
  let at = 0;
  return (
    <section class="panel metres" aria-label="Metres by verdict">
      <div class="panel-head"><h2>Metres</h2><span class="count">{all ? `${metres(all.way_m)} in total` : ""}</span></div>
      <svg class="bar" viewBox="0 0 1000 20" preserveAspectRatio="none" aria-hidden="true">
        <defs>
          <pattern id="unsure" width="10" height="10" patternUnits="userSpaceOnUse" patternTransform="rotate(45)"><rect width="10" height="10" class="v-cannot-say" /><rect width="4" height="10" class="v-stripe" /></pattern>
          <pattern id="unpassed" width="10" height="10" patternUnits="userSpaceOnUse" patternTransform="rotate(-45)"><rect width="10" height="10" class="v-open" /><rect width="3" height="10" class="v-grey-stripe" /></pattern>
        </defs>
        {ORDER.map((key) => {
          const share = ((all?.[`${key}_m`] ?? 0) / whole) * 1000, x = at;
          at += share;
          return <rect key={key} x={x} y="0" width={Math.max(share > 0 ? 4 : 0, share)} height="20" class={`v-${key.replaceAll("_", "-")}`} />;
        })}
      </svg>
      <dl>
        {ORDER.map((key) => (
          <div key={key} class={key === "fail" && (all?.fail_m ?? 0) > 0 ? "bad" : ""}>
            <dt><i class={`key v-${key.replaceAll("_", "-")}`} />{VERDICTS[key]}</dt><dd>{all ? metres(all[`${key}_m`]) : "–"}</dd>
          </div>
        ))}
      </dl>
      <Compared />
      <Left />
    </section>
  );
}

/** Lengths by verdict for the second target of a replay. */
function Compared() {
  const other = store.state?.compared;
  if (!other) return null;
  return (
    <p class="compared">
      <b>T {figure(other.target_m, 2)} m:</b>{" "}
      {(["pass", "fail", "cannot_say", "open", "not_inspected"] as const).map((key) => `${VERDICTS[key]} ${metres(other[`${key}_m`])}`).join(" · ")}
    </p>
  );
}

function Left() {
  const left = store.state?.left;
  if (!left || (left.cable_m === null && left.time_s === null && left.battery_pct === null)) return null;
  return (
    <dl class="left" aria-label="Remaining cable, time and battery">
      {left.cable_m === null ? null : <div class={left.cable_m < 50 ? "bad" : ""}><dt>cable left</dt><dd>{metres(left.cable_m)}</dd></div>}
      {left.time_s === null ? null : <div class={left.time_s < 600 ? "bad" : ""}><dt>time left</dt><dd>{span(left.time_s)}</dd></div>}
      {left.battery_pct === null ? null : <div class={left.battery_pct < 25 ? "bad" : ""}><dt>battery</dt><dd>{figure(left.battery_pct, 0)} %</dd></div>}
    </dl>
  );
}

/** The next steps of the plan for the rest of the dive. */
function Steps({ steps }: { steps: Step[] }) {
  return (
    <ol class="steps" tabIndex={0} aria-label="The next steps">
      {steps.map(({ text, from_m, to_m }, n) => (
        <li key={n} class={n === 0 ? "now" : ""}><button type="button" class="leg" onClick={() => actions.goTo((from_m + to_m) / 2, 30)}>{n + 1}. {text}</button></li>
      ))}
    </ol>
  );
}

export function Back() {
  useTopics(store.topics.back, store.topics.state);
  // A file has the way back only for the end of the dive.
  const known = store.link.phase !== "file" || hasEnded(store);
  const { legs, way_m, time_s } = known ? store.back : { legs: [], way_m: 0, time_s: 0 };
  const plan = hasEnded(store) ? null : store.state?.plan ?? null;
  const totals = plan !== null ? [plan.fits] : legs.length === 0 ? [] : [legs.length > 1 ? `${legs.length} stretches` : null, metres(way_m), time_s === null ? null : span(time_s)];
  return (
    <section class="panel back" aria-label="The way back">
      <div class="panel-head"><h2>Way back</h2><span class={plan?.all_fits === false ? "count bad" : "count"}>{totals.filter((part) => part !== null).join(", ")}</span></div>
      {plan !== null ? <Steps steps={plan.steps} /> : legs.length === 0 ? <p class="none">{known ? "nothing to go back for" : "a file has this list only for the end of the dive"}</p> : (
        <ol tabIndex={0} aria-label="Stretches to pass again, in order">
          {legs.map((leg) => (
            <li key={`${leg.from_m}-${leg.to_m}`}>
              <button type="button" class="leg" title={`${station(leg.from_m, 2)}–${station(leg.to_m, 2)}`} onClick={() => actions.goTo((leg.from_m + leg.to_m) / 2, 30)}>
                <b>{stretch(leg.from_m, leg.to_m)}</b>{leg.at_most_mps === null ? "" : <> <span class="at-most">≤ {speedDown(leg.at_most_mps)} m/s</span></>}{leg.back_to_m === undefined ? "" : <> until <b>{station(leg.back_to_m, 1)}</b></>} <span class="leg-why">{plain(leg.why)}</span>
              </button>
            </li>
          ))}
        </ol>
      )}
    </section>
  );
}
