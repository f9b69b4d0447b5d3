// The unrolled wall: a WebGL2 canvas, a canvas for labels, and a strip that shows the whole tunnel.
import { useEffect, useRef, useState } from "preact/hooks";
import { samples as fetchSamples } from "../feed/client";
import { prefsTopic } from "../store/prefs";
import { store } from "../store/store";
import { figure, station } from "../text/format";
import { VERDICTS } from "../text/table";
import { plain } from "../text/words";
import { fit, useSize, type Size } from "../ui/canvas";
import { colour } from "../ui/colours";
import { actions, current, vehicle, viewTopic, wayOf, whole } from "./control";
import { columns, WORDS } from "./columns";
import { usePointer } from "./pointer";
import { WallGl, type Part, type WallColours } from "./gl";
import { Legend, Scale } from "./Legend";
import { drawOverlay, type Layout, type Row } from "./overlay";
import { SampleWindow } from "./samples";
import { left_m, right_m, roundOf, wholeView, type Round, type View } from "./view";

const LEFT = 30, TOP = 8, BOTTOM = 24, STRIP = 34, STRIP_BOTTOM = 18;
/** Gap between two walls, pixels. */
const BETWEEN = 16;
/** Verdicts by their number in the feed. */
const NUMBERED = [VERDICTS.open, VERDICTS.pass, VERDICTS.fail, VERDICTS.cannot_say, VERDICTS.not_inspected];
/** Minimum radius of a disc in pixels, and widest view in which discs are drawn. */
const LEAST_RADIUS = 2.2, DISCS_UPTO_M = 160;

function layoutOf({ width, height }: Size): Layout {
  const strip = height > 170 ? STRIP : 0;
  const stripTop = height - strip - STRIP_BOTTOM;
  return { left: LEFT, top: TOP, width: Math.max(10, width - LEFT), height: Math.max(10, (strip ? stripTop : height) - BOTTOM - TOP), stripTop, stripHeight: strip };
}

function wallColours(): WallColours {
  return {
    blank: colour("wall-blank"), open: colour("wall-open"), missed: colour("wall-missed"), flag: colour("wall-flag"),
    hatch: colour("wall-hatch"), grey: colour("wall-grey"), dot: colour("wall-dot"), fresh: colour("wall-fresh"), gain: Number(getComputedStyle(document.documentElement).getPropertyValue("--wall-gain")) || 1,
  };
}

/** Draws the wall without the component framework. */
class Painter {
  private size: Size = { width: 0, height: 0, scale: 1 };
  private readonly gl: WallGl;
  private readonly words = new Uint32Array(8192 * WORDS);
  private readonly stripWords = new Uint32Array(8192 * WORDS);
  private stripKey = "";
  private readonly window: SampleWindow;
  private readonly turns = new Float32Array(16);
  private colours = wallColours();
  private round: Round = { crown: 0.5, sign: 1 };
  private session = 0;
  private asked = 0;
  layout = layoutOf(this.size);

  constructor(private readonly wall: HTMLCanvasElement, private readonly over: HTMLCanvasElement) {
    this.gl = new WallGl(wall);
    this.window = new SampleWindow(fetchSamples, () => this.draw());
  }

  resize(size: Size): void {
    this.size = size;
    this.layout = layoutOf(size);
    fit(this.wall, size);
    fit(this.over, size);
    this.paint();
  }

  palette(): void {
    this.colours = wallColours();
    this.draw();
  }

  restored(): void {
    this.gl.make();
    this.window.uploaded = 0;
    this.draw();
  }

  live(frame: Parameters<SampleWindow["take"]>[0]): void {
    this.window.take(frame);
  }

  stripView(): View {
    const [from, to] = whole();
    return { ...wholeView(current(), from, to), span_m: to - from };
  }

  /** Requests one drawing at the next frame. */
  draw(): void {
    if (this.asked !== 0) return;
    this.asked = requestAnimationFrame(() => {
      this.asked = 0;
      this.paint();
    });
  }

  private paint(): void {
    const { hello } = store;
    const { scale, width, height } = this.size;
    if (width === 0 || height === 0) return;
    this.gl.begin(this.colours);
    const context = this.over.getContext("2d");
    if (!context) return;
    context.setTransform(scale, 0, 0, scale, 0, 0);
    context.clearRect(0, 0, width, height);
    if (!hello) return;
    // The window misses samples that were sent while the connection was lost, so a new connection clears it.
    if (this.session !== store.session) this.window.clear();
    this.session = store.session;
    this.round = roundOf(hello.clock_arc_m, hello.perimeter_m);
    const view = current(), strip = this.stripView(), layout = this.layout;
    const rows = this.rows(hello.target_m, hello.compared_m);
    for (const row of rows) this.paintPart(row.held, view, row, true);
    if (layout.stripHeight > 0) {
      this.paintPart("strip", strip, { held: "own", target_m: hello.target_m, top: layout.stripTop, height: layout.stripHeight }, false);
    }
    drawOverlay(context, store, view, strip, layout, vehicle(), this.round, rows);
  }

  /** The wall, and below it the wall for the second target if there is one. */
  private rows(target_m: number, compared_m: number | undefined): Row[] {
    const { top, height } = this.layout;
    if (compared_m === undefined) return [{ held: "own", target_m, top, height }];
    const each = (height - BETWEEN) / 2;
    return [{ held: "own", target_m, top, height: each }, { held: "compared", target_m: compared_m, top: top + each + BETWEEN, height: each }];
  }

  private paintPart(name: string, view: View, { held, target_m, top, height }: Row, large: boolean): void {
    const { hello } = store, { scale } = this.size;
    if (!hello) return;
    const part: Part = {
      x: Math.round(this.layout.left * scale), y: this.wall.height - Math.round((top + height) * scale),
      width: Math.min(Math.round(this.layout.width * scale), this.wall.width - Math.round(this.layout.left * scale)), height: Math.round(height * scale),
    };
    const words = large ? this.words : this.stripWords;
    // The strip of the whole tunnel is computed again only when the wall or the strip's range changes.
    const key = large ? "" : `${store.topics.sections.version} ${left_m(view)} ${view.span_m} ${part.width}`;
    if (large || key !== this.stripKey) {
      columns(store.sections, hello.section_m, target_m, left_m(view), view.span_m / part.width, part.width, words, held);
    }
    if (!large) this.stripKey = key;
    this.gl.draw(name, { part, columns: words, view, round: this.round, scale, discs: large ? this.discs(view, target_m) : null }, this.colours);
  }

  private discs(view: View, target_m: number) {
    const { hello } = store;
    if (!hello) return null;
    const radius = ((target_m / 2) * this.layout.width) / view.span_m;
    if (radius < LEAST_RADIUS || view.span_m > DISCS_UPTO_M) return null;
    const widest_m = Math.max(hello.target_m, hello.compared_m ?? 0);
    const from = left_m(view) - widest_m, to = right_m(view) + widest_m, way = wayOf();
    if (!store.ready) return null;
    this.window.round = this.round;
    this.window.seam = widest_m / 2 / hello.perimeter_m;
    this.window.want(from, to, way);
    if (!this.window.covers(Math.max(from, way[0]), Math.min(to, way[1]))) return null;
    this.turns.fill(Infinity);
    store.turns.heads.forEach((head, at) => {
      const first = head.present[0];
      if (first && at < 16) this.turns[at] = first.t_s - 0.0005;
    });
    // Live samples may arrive shortly before their state.
    const now_s = store.link.phase === "file" ? (store.state?.now_s ?? 0) : 1e9;
    return { samples: this.window, now_s, radius_m: target_m / 2, perimeter_m: hello.perimeter_m, turn_t_s: this.turns };
  }

  /** Text about the place under the pointer. */
  at(x: number, y: number): string {
    const { hello, sections } = store, { left, top, width, height } = this.layout;
    if (!hello || x < left || y < top || y > top + height) return "";
    const view = current(), x_m = left_m(view) + ((x - left) / width) * view.span_m;
    const slot = sections.slot(Math.floor(x_m / hello.section_m));
    if (slot < 0) return station(x_m, 1);
    const row = this.rows(hello.target_m, hello.compared_m).find((each) => y <= each.top + each.height);
    const held = row?.held ?? "own", target_m = row?.target_m ?? hello.target_m;
    const verdict = NUMBERED[sections.verdictOf(slot, held)] ?? "";
    // Causes and reasons are known only for the dive's own target.
    const own = held === "own" ? slot : -1, cause = hello.causes[sections.cause[own] ?? 255], why = hello.whys[sections.why[own] ?? 255];
    const words = [cause, why].filter((word) => word !== undefined).map(plain).join(", ");
    const d = sections.hole[slot] ?? NaN;
    return `${station(x_m, 1)}: ${verdict}${words ? ` (${words})` : ""}${Number.isFinite(d) ? `, hole ${figure(d, 2)} m (limit ${figure(target_m, 2)})` : ""}`;
  }
}

export function Wall() {
  const wall = useRef<HTMLCanvasElement>(null), over = useRef<HTMLCanvasElement>(null);
  const painter = useRef<Painter | null>(null);
  const [why, setWhy] = useState("");
  const [under, setUnder] = useState("");
  const box = useSize<HTMLDivElement>((size) => painter.current?.resize(size));

  useEffect(() => {
    const canvas = wall.current;
    if (!canvas || !over.current) return undefined;
    let its: Painter;
    try {
      its = new Painter(canvas, over.current);
    } catch (error) {
      setWhy(error instanceof Error ? error.message : String(error));
      return undefined;
    }
    painter.current = its;
    const draw = () => its.draw();
    const { sections, samples, state, hello, alerts } = store.topics;
    const offs = [sections, samples, state, hello, alerts, viewTopic].map((topic) => topic.on(draw));
    offs.push(prefsTopic.on(() => its.palette()), store.onSamples((frame) => its.live(frame)));
    const lost = (event: Event) => event.preventDefault();
    const restored = () => its.restored();
    canvas.addEventListener("webglcontextlost", lost);
    canvas.addEventListener("webglcontextrestored", restored);
    if (box.current) its.resize({ width: box.current.clientWidth, height: box.current.clientHeight, scale: Math.min(devicePixelRatio || 1, 2) });
    return () => {
      offs.forEach((off) => off());
      canvas.removeEventListener("webglcontextlost", lost);
      canvas.removeEventListener("webglcontextrestored", restored);
      painter.current = null;
    };
  }, []);
  usePointer(box, painter, setUnder);

  return (
    <section class="panel wall" aria-label="Unrolled wall">
      <div class="wall-head">
        <h2>Wall</h2>
        <Scale />
        <span class="under" aria-hidden="true">{under}</span>
        <span class="buttons">
          <button type="button" onClick={() => actions.zoom(0.5)} title="Zoom in (+)" aria-label="Zoom in">+</button>
          <button type="button" onClick={() => actions.zoom(2)} title="Zoom out (-)" aria-label="Zoom out">−</button>
          <button type="button" onClick={actions.follow} title="Follow the vehicle (F)">Follow</button>
          <button type="button" onClick={actions.whole} title="Whole tunnel (0)">Whole</button>
        </span>
      </div>
      <Legend />
      <div class="wall-box" ref={box}>
        {why ? <p class="missing" role="alert">The wall can't be drawn: {why}. Everything else works.</p> : null}
        <canvas ref={wall} aria-hidden="true" />
        <canvas ref={over} class="over" role="img" aria-label="Unrolled wall, chainage across and clock positions down; the metres by verdict and the alerts state the same as text" />
      </div>
    </section>
  );
}

export type { Painter };
