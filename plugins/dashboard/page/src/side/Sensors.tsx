// A lamp for every sensor, with its state in words, its rate and its age. The age grows while no data arrive.
import { hasEnded, OLD_AFTER_S, sinceState_s } from "../store/age";
import type { Sensor } from "../feed/types";
import { store } from "../store/store";
import { useTopics } from "../store/topic";
import { figure, span } from "../text/format";
import { SENSOR_STATES } from "../text/table";
import { Shape } from "../ui/Shape";

export function Sensors() {
  useTopics(store.topics.state, store.topics.hello, store.topics.clock);
  const { state, hello } = store;
  const since = sinceState_s(store), ended = hasEnded(store);
  return (
    <section class={`panel sensors${ended ? " ended" : ""}`} aria-label="Sensors">
      <div class="panel-head"><h2>Sensors</h2>{ended ? <span class="count">at the end</span> : null}</div>
      <ul>
        {inOrder(state?.sensors ?? []).map((sensor) => {
          const age = sensor.age_s === null ? null : sensor.age_s + since;
          // The state of the sensors is unknown while there is no connection to the program.
          const is = since > OLD_AFTER_S ? "unknown" : sensor.state;
          const lamp = ended ? "none" : is === "ok" ? "green" : is === "unknown" ? "none" : is === "stalled" || is === "distrusted" ? "amber" : "red";
          const hz = state?.rates?.find((rate) => rate.id === sensor.id)?.hz;
          const kind = hello?.sensors.find((each) => each.id === sensor.id)?.kind ?? "";
          const word = is === "unknown" ? is : (sensor.withheld ?? SENSOR_STATES[is] ?? is);
          return (
            <li key={sensor.id} class={`sensor ${lamp}`} data-sensor={sensor.id} data-state={is} title={kind}>
              <Shape lamp={lamp} size={18} />
              <span class="id">{sensor.id}</span>
              {ended ? <span class="rate">{word}</span>
                : is === "ok" ? <span class="rate">{hz === undefined ? "" : `${figure(hz, hz < 10 ? 1 : 0)} Hz`}</span>
                : <span class="bad">{word} {age === null || is === "unknown" ? "" : span(age)}</span>}
            </li>
          );
        })}
      </ul>
      <Recording />
    </section>
  );
}

/** Sensors with trouble come first, so that they are always visible. */
function inOrder(sensors: Sensor[]): Sensor[] {
  return [...sensors.filter(({ state }) => state !== "ok"), ...sensors.filter(({ state }) => state === "ok")];
}

function Recording() {
  const recording = store.state?.recording;
  // A dive in a file has been recorded; the field describes the export.
  if (!recording || store.link.phase === "file") return null;
  const ended = hasEnded(store);
  const lamp = ended ? "none" : recording.fails ? "red" : !recording.on ? "none" : recording.words ? "amber" : "green";
  const words = recording.words ?? (recording.on ? (ended ? "recorded" : "recording") : "not recorded");
  return <div class={`recording sensor ${lamp}`} title={recording.path ?? ""}><Shape lamp={lamp} size={18} /><span class="id">{words}</span></div>;
}
