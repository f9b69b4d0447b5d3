// The condition, the speed, and its limit with the reason. A pilot can read them from two metres away.
import type { Speeds } from "../feed/types";
import { shown, age_s, hasEnded, isOld, outstandingOf, sinceState_s } from "../store/age";
import { store } from "../store/store";
import { useTopics } from "../store/topic";
import { figure, heading, span, station } from "../text/format";
import { REASONS } from "../text/table";
import { utcOf } from "../text/times";
import { positionWhy, speedsOf, UNBOUNDED } from "../text/words";
import { Shape } from "../ui/Shape";
import { Time } from "../ui/Time";
import { marks, scaleEnd, TOO_FAST } from "./gauge";

export function Condition() {
  useTopics(store.topics.state, store.topics.link, store.topics.clock);
  const { word, advice, lamp, old } = shown(store);
  // The lamp describes the present. Missed sections are shown beside it until they have been passed.
  const outstanding = lamp === "ended" ? null : outstandingOf(store);
  return (
    <div class={`condition ${lamp}${old ? " old" : ""}${word.length > 14 ? " longest" : word.length > 9 ? " long" : ""}`} data-condition={store.state?.condition ?? ""}>
      <div class="lamp">
        <Shape lamp={lamp} size={64} />
        <div>
          <div class="word">{word}</div>
          <div class="advice">{advice}</div>
        </div>
      </div>
      {outstanding === null ? null : <p class="outstanding">{outstanding}</p>}
    </div>
  );
}

/** Announces the condition when it changes. The running count of seconds is left out. */
export function Announcer() {
  useTopics(store.topics.state, store.topics.link, store.topics.clock);
  const { word, advice } = shown(store);
  const said = `${word.replace(/\d.*$/, "")} ${store.link.phase === "open" ? advice : ""}`;
  return <div class="sr" role="status" aria-live="polite">{said}</div>;
}

export function Speed() {
  useTopics(store.topics.state);
  const { state } = store;
  const unbounded = state ? UNBOUNDED[state.condition] : undefined;
  const texts = state ? speedsOf(state) : { speed: null, limit: null, margin: null };
  const speed = state?.speed_mps ?? null, most = texts.limit === null ? null : (state?.v_max_mps ?? null);
  // A reason without a limit is shown only if no speed meets the target.
  const limited = unbounded === undefined && (texts.limit !== null || state?.v_max_mps === null), lost = state?.margins.lost_share ?? null;
  return (
    <div class="speed">
      <div class="figures">
        <div class="now"><span class="value">{texts.speed ?? "–"}</span><span class="unit">m/s{speed !== null && speed < -0.02 ? " back" : ""}</span></div>
        <div class="allowed">
          {texts.limit === null ? null : <div class="most"><span class="name">max</span><span class="value">{texts.limit}</span><span class="unit">m/s</span></div>}
          {texts.margin === null ? null : <div class="margin">{texts.margin}</div>}
        </div>
      </div>
      <Gauge speed={speed} most={most} texts={texts} />
      <div class="why">
        {state?.reason && limited ? <span><b>limit</b> {lost === null ? (REASONS[state.reason] ?? state.reason) : `${figure(100 * lost, 0)} % of returns lost`}</span> : null}
        {state?.remedy && limited ? <span class="remedy"><b>faster option</b> {state.remedy}</span> : null}
      </div>
      {unbounded === undefined ? <Forecast /> : <div class="forecast">{unbounded}</div>}
    </div>
  );
}

function Gauge({ speed, most, texts }: { speed: number | null; most: number | null; texts: Speeds }) {
  const end = scaleEnd(speed, most), x = (v: number): number => Math.min(1000, (Math.abs(v) / end) * 1000);
  const at = speed === null ? null : x(speed);
  const told = texts.speed === null ? "no speed" : `${texts.speed} metres per second, ${texts.limit === null ? "no limit" : `limit ${texts.limit}`}`;
  return (
    <div class="gauge-box">
    <svg class="gauge" viewBox="-14 0 1028 66" role="img" aria-label={`Speed: ${told}`} preserveAspectRatio="none">
      <defs>
        <pattern id="over" width="14" height="14" patternUnits="userSpaceOnUse" patternTransform="rotate(45)"><rect width="14" height="14" class="zone-red" /><rect width="5" height="14" class="zone-stripe" /></pattern>
      </defs>
      <rect x="0" y="22" width="1000" height="34" class="zone-none" />
      {most === null ? null : <>
        <rect x="0" y="22" width={x(most)} height="34" class="zone-green" />
        <rect x={x(most)} y="22" width={x(most * TOO_FAST) - x(most)} height="34" class="zone-amber" />
        <rect x={x(most * TOO_FAST)} y="22" width={1000 - x(most * TOO_FAST)} height="34" fill="url(#over)" />
        <path class="limit" d={`M${x(most)} 14V64`} />
      </>}
      {marks(end).map((v) => <path class="tick" key={v} d={`M${x(v)} 56v9`} />)}
      {at === null ? null : <path class="needle" d={`M${at} 58L${at - 13} 4H${at + 13}Z`} />}
    </svg>
    <div class="ticks" aria-hidden="true">{marks(end).map((v) => <span key={v} style={{ left: `${((x(v) + 14) / 1028) * 100}%` }}>{figure(v, end < 1 ? 2 : 1)}</span>)}</div>
    </div>
  );
}

/** Forecast of the present turn, compared with the target. */
function Forecast() {
  const turn = store.state?.turn ?? null;
  if (!turn) return <div class="forecast">no forecast for this turn</div>;
  const { predicted_t_m, target_m, will_exceed } = turn, lost = store.state?.margins.lost_share ?? null;
  const share = predicted_t_m === null ? 1 : Math.min(1, predicted_t_m / (2 * target_m));
  const over = predicted_t_m === null || predicted_t_m > target_m;
  return (
    <div class={`forecast${over ? " over" : ""}`}>
      <span>this turn: largest hole {predicted_t_m === null ? "unbounded" : `${figure(predicted_t_m, 2)} m`} (limit {figure(target_m, 2)}){lost === null ? "" : " without losses"} {over ? (will_exceed ? "▲ misses" : "▲") : "✓"}</span>
      <svg viewBox="0 0 200 8" preserveAspectRatio="none" aria-hidden="true"><rect width="200" height="8" class="zone-none" /><rect width={share * 200} height="8" class={over ? "zone-red" : "zone-green"} /><path class="limit" d="M100 0V8" /></svg>
    </div>
  );
}

export function Place() {
  useTopics(store.topics.state, store.topics.clock, store.topics.link);
  const { state } = store, position = state?.position;
  const dead = !position || position.state === "none";
  return (
    <div class="place">
      <div class={`chainage${dead ? " dead" : ""}`}>{dead ? "no position" : station(position.chainage_m ?? 0, 1)}</div>
      <div class="sure">
        {dead ? positionWhy(position?.why) : <>± {figure(position.chainage_sd_m === null ? null : 2 * position.chainage_sd_m, 2)} m (95 %){position.state === "doubtful" ? <b class="doubt"> doubtful: {positionWhy(position.why)}</b> : null}</>}
      </div>
      <Ages />
      <DiveClock />
      <div class="pose">
        {state?.depth_m === undefined || state.depth_m === null ? null : <span class="depth">depth <b>{figure(state.depth_m, 1)} m</b></span>}
        {state?.pose ? <span class="heading">heading <b>{heading(state.pose.yaw_deg)}</b></span> : null}
      </div>
    </div>
  );
}

/** Age of the data. It has no meaning after the end of the dive. */
function Ages() {
  const age = age_s(store), file = store.link.phase === "file";
  if (file || hasEnded(store)) return <div class="age">{file ? "from a file" : "at the end of the dive"}</div>;
  return <div class={`age${isOld(store) ? " old" : ""}`}>data {age === null ? "–" : span(age)} old</div>;
}

/** Time of the dive, and UTC if it is known. In a live dive it goes on while no data arrive. */
function DiveClock() {
  const { state, hello } = store;
  if (!state || state.at_s === null) return null;
  const now_s = state.now_s + (hello?.mode === "live" ? sinceState_s(store) : 0), utc = utcOf(hello, now_s);
  return <div class="clock"><span>dive <b><Time at_s={now_s} /></b></span> {utc === "" ? null : <span class="utc">{utc.slice(11)}</span>}</div>;
}
