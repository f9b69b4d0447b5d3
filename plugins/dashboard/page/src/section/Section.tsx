import { useEffect, useRef } from "preact/hooks";
import { prefsTopic } from "../store/prefs";
import { store } from "../store/store";
import { useTopics } from "../store/topic";
import { figure } from "../text/format";
import { hasEnded, isOld } from "../store/age";
import { fit, useSize, type Size } from "../ui/canvas";
import { drawSection } from "./draw";
import { wallWarning } from "./walls";

export function Section() {
  const canvas = useRef<HTMLCanvasElement>(null), size = useRef<Size>({ width: 0, height: 0, scale: 1 });
  const draw = () => {
    const context = canvas.current?.getContext("2d"), { width, height, scale } = size.current;
    if (!context || width === 0) return;
    context.setTransform(scale, 0, 0, scale, 0, 0);
    drawSection(context, store, width, height);
  };
  const box = useSize<HTMLDivElement>((next) => {
    size.current = next;
    if (canvas.current) fit(canvas.current, next);
    draw();
  });
  useEffect(() => {
    const { state, samples, hello } = store.topics;
    const offs = [state, samples, hello, prefsTopic].map((topic) => topic.on(draw));
    return () => offs.forEach((off) => off());
  }, []);
  return (
    <section class="panel section" aria-label="Cross-section">
      <div class="panel-head"><h2>Section</h2><Attitude /></div>
      <Close />
      <div class="section-box" ref={box}>
        <canvas ref={canvas} role="img" aria-label="Cross-section looking inwards: profile, returns of this turn and the last, heads, echosounders and the vehicle" />
      </div>
    </section>
  );
}

/** Warning about a close wall. It describes the present, so it is empty while the data is old. */
function Close() {
  useTopics(store.topics.state, store.topics.clock);
  const words = hasEnded(store) || isOld(store) ? "" : wallWarning(store.state?.echosounders ?? []);
  return <p class="close-wall" role="status">{words}</p>;
}

function Attitude() {
  useTopics(store.topics.state);
  const pose = store.state?.pose;
  if (!pose) return <span class="attitude">attitude unknown</span>;
  return <span class="attitude">roll {figure(pose.roll_deg, 0)}° pitch {figure(pose.pitch_deg, 0)}°</span>;
}
