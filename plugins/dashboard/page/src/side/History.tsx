// Chart of the speed and its limit over the last half hour.
import { useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { prefsTopic } from "../store/prefs";
import { store } from "../store/store";
import { clock, figure } from "../text/format";
import { utcOf } from "../text/times";
import { useSize } from "../ui/canvas";
import { colour } from "../ui/colours";

function options(width: number, height: number): uPlot.Options {
  const axis = { stroke: colour("faint"), grid: { stroke: colour("line"), width: 1 }, ticks: { stroke: colour("line"), width: 1, size: 4 }, gap: 3, font: "11px system-ui" };
  return {
    width, height, legend: { show: false }, cursor: { show: false }, padding: [6, 18, 0, 0],
    scales: { x: { time: false }, y: { range: (_, __, most) => [0, Math.max(0.1, (Number.isFinite(most) ? most : 0) * 1.15)] } },
    axes: [
      { ...axis, size: 22, values: (_, ticks) => ticks.map((t) => clock(t)) },
      { ...axis, size: 40, values: (_, ticks) => ticks.map((v) => figure(v, 2)) },
    ],
    series: [
      {},
      { label: "speed", stroke: colour("ink"), width: 2, points: { show: false } },
      { label: "v max", stroke: colour("limit"), width: 2, dash: [6, 4], points: { show: false } },
    ],
  };
}

function data(): uPlot.AlignedData {
  const { t_s, v_mps, v_max_mps } = store.history;
  return [t_s, v_mps.map((v) => (v === null ? null : Math.abs(v))), v_max_mps] as uPlot.AlignedData;
}

export function History() {
  const plot = useRef<uPlot | null>(null);
  const make = (): void => {
    const its = box.current;
    if (!its) return;
    plot.current?.destroy();
    plot.current = new uPlot(options(Math.max(its.clientWidth, 50), Math.max(its.clientHeight, 40)), data(), its);
  };
  /** Gives the time under the pointer as a tooltip. */
  const hover = (event: PointerEvent): void => {
    if (!plot.current || !box.current) return;
    const at_s = plot.current.posToVal(event.clientX - plot.current.over.getBoundingClientRect().left, "x");
    box.current.title = [clock(at_s), utcOf(store.hello, at_s)].filter((part) => part !== "").join(", ");
  };
  const box = useSize<HTMLDivElement>(({ width, height }) => plot.current?.setSize({ width: Math.max(width, 50), height: Math.max(height, 40) }));
  useEffect(() => {
    make();
    const offs = [store.topics.history.on(() => plot.current?.setData(data())), prefsTopic.on(make)];
    return () => {
      offs.forEach((off) => off());
      plot.current?.destroy();
      plot.current = null;
    };
  }, []);
  return (
    <section class="panel history" aria-label="Speed history">
      <div class="panel-head"><h2>Speed</h2><span class="count"><i class="stroke now" /> now <i class="stroke most" /> max m/s</span></div>
      <div class="history-box" ref={box} onPointerMove={hover} role="img" aria-label="Speed and the largest speed allowed over the last half hour" />
    </section>
  );
}
