// Playback controls of a replay, a demo, or a dive in a file: pause, speed, steps and a time slider.
import { seekFile, send, stepFile } from "../feed/client";
import { store } from "../store/store";
import { useTopics } from "../store/topic";
import { hasEnded } from "../store/age";
import { clock } from "../text/format";
import { Time } from "../ui/Time";

const SPEEDS: (number | null)[] = [0.25, 0.5, 1, 2, 4, 8, 16, 64, null];

export const play = {
  toggle(): void {
    if (!may() || isFile()) return;
    send({ do: "play", command: store.state?.playback?.paused ? "go" : "pause" });
  },
  step(): void {
    if (!may()) return;
    if (isFile()) stepFile(1);
    else send({ do: "play", command: "step" });
  },
  section(): void {
    if (!may()) return;
    if (isFile()) stepFile(10);
    else send({ do: "play", command: "step_section" });
  },
  by(seconds: number): void {
    const playback = store.state?.playback;
    if (playback && may()) play.to(playback.at_s + seconds);
  },
  to(at_s: number): void {
    const playback = store.state?.playback;
    if (!playback || !may()) return;
    const to_s = Math.min(Math.max(at_s, playback.from_s), playback.to_s);
    if (isFile()) seekFile(to_s);
    else send({ do: "play", command: "seek", to_s });
  },
  speed(by: number): void {
    const now = SPEEDS.indexOf(store.state?.playback?.speed ?? null);
    const next = SPEEDS[Math.min(Math.max((now < 0 ? 2 : now) + by, 0), SPEEDS.length - 1)];
    if (may() && !isFile() && next !== undefined) send({ do: "play", command: "speed", speed: next });
  },
  end(): void {
    if (may() && !isFile()) send({ do: "play", command: "end" });
  },
};

const isFile = (): boolean => store.link.phase === "file";
const may = (): boolean => isFile() || (store.hello?.may.playback ?? false);
const name = (speed: number | null): string => (speed === null ? "fastest" : `${speed}×`);

export function Replay() {
  useTopics(store.topics.state, store.topics.hello, store.topics.link);
  const playback = store.state?.playback;
  if (!playback) return null;
  const off = !may(), file = isFile(), { at_s, from_s, to_s, paused, speed } = playback;
  return (
    <section class="panel replay" aria-label="Replay">
      {file ? null : <button type="button" disabled={off} onClick={play.toggle} title="Space">{paused ? "▶ Continue" : "❚❚ Pause"}</button>}
      <button type="button" disabled={off} onClick={play.step} title="Step (.)">{file ? "+1 s" : "Step"}</button>
      <button type="button" disabled={off} onClick={play.section} title="Step by a section (,)">{file ? "+10 s" : "Section"}</button>
      <input type="range" min={from_s} max={Math.max(to_s, from_s + 0.1)} step="any" value={at_s} disabled={off} aria-label="Time of the dive"
        aria-valuetext={`${clock(at_s)} of ${clock(to_s)}`} onChange={(event) => play.to(Number(event.currentTarget.value))}
        onInput={(event) => file && play.to(Number(event.currentTarget.value))} />
      <span class="at"><Time at_s={at_s} /> / <Time at_s={to_s} /></span>
      {file && !hasEnded(store) ? <span class="count">wall and alerts: state at the end</span> : null}
      {file ? null : (
        <label class="speed-choice"><span class="sr">Speed of the replay</span>
          <select disabled={off} value={String(speed)} onChange={(event) => send({ do: "play", command: "speed", speed: event.currentTarget.value === "null" ? null : Number(event.currentTarget.value) })}>
            {[...new Set([...SPEEDS, speed])].map((each) => <option key={String(each)} value={String(each)}>{name(each)}</option>)}
          </select>
        </label>
      )}
      {paused && !file && !hasEnded(store) ? <b class="paused">PAUSED</b> : null}
    </section>
  );
}
