// Draws labels over the wall: stations, clock positions, holes, alerts and the vehicle.
import { CANNOT_SAY, FAIL, type Held } from "../store/sections";
import { isUnacknowledged } from "../store/alerts";
import type { Store } from "../store/store";
import { figure, station } from "../text/format";
import { colour } from "../ui/colours";
import { downOf, heightOf, left_m, right_m, type Round, type View } from "./view";

/** Positions in CSS pixels. */
export interface Layout { left: number; top: number; width: number; height: number; stripTop: number; stripHeight: number }
/** One row of the display: the same samples, judged by one target. */
export interface Row { held: Held; target_m: number; top: number; height: number }
export interface Vehicle { at_m: number; sd_m: number; direction: number; sure: boolean }

const FONT = "system-ui, 'DejaVu Sans', sans-serif";

export function drawOverlay(
  context: CanvasRenderingContext2D, store: Store, view: View, strip: View, layout: Layout, vehicle: Vehicle | null, round: Round, rows: Row[],
): void {
  context.textBaseline = "middle";
  for (const row of rows) {
    const { left, top, width, height } = { ...layout, ...row }, its = { ...layout, ...row };
    clocks(context, store, view, its, round);
    context.save();
    context.beginPath();
    context.rect(left, top, width, height);
    context.clip();
    holes(context, store, view, its, round, row);
    if (row.held === "own") missed(context, store, view, its);
    if (vehicle) drawVehicle(context, view, its, vehicle);
    if (rows.length > 1) named(context, its, row);
    context.restore();
  }
  stations(context, view, layout);
  drawStrip(context, store, view, strip, layout, vehicle);
}

/** Writes a row's target into its upper corner. */
function named(context: CanvasRenderingContext2D, { left, top }: Layout, { target_m }: Row): void {
  context.font = `bold 15px ${FONT}`;
  context.textAlign = "left";
  label(context, `T ${figure(target_m, 2)} m`, left + 8, top + 14, colour("wall-fresh"), colour("wall-dot"));
}

function across(view: View, layout: Layout, x_m: number): number {
  return layout.left + ((x_m - left_m(view)) / view.span_m) * layout.width;
}

function clocks(context: CanvasRenderingContext2D, store: Store, view: View, layout: Layout, round: Round): void {
  const hello = store.hello;
  if (!hello) return;
  context.textAlign = "right";
  const drawn: number[] = [];
  // The labels of 12, 3, 6 and 9 are placed first. Labels of other hours are left out where there is no room.
  for (const hour of [0, 3, 6, 9, 1, 2, 4, 5, 7, 8, 10, 11]) {
    const down = downOf(round, (hello.clock_arc_m[hour] ?? 0) / hello.perimeter_m);
    for (const turn of [-1, 0, 1]) {
      const at = heightOf(view, down + turn);
      if (at < -0.001 || at > 1.001) continue;
      const y = layout.top + at * layout.height, big = hour % 3 === 0;
      context.strokeStyle = colour("grid");
      context.globalAlpha = big ? 0.6 : 0.25;
      context.beginPath();
      context.moveTo(layout.left, y);
      context.lineTo(layout.left + layout.width, y);
      context.stroke();
      context.globalAlpha = 1;
      const middle = Math.min(Math.max(y, 8), layout.top + layout.height);
      if (drawn.some((other) => Math.abs(other - middle) < 14)) continue;
      drawn.push(middle);
      context.fillStyle = colour(big ? "ink" : "faint");
      context.font = `${big ? "bold 15px" : "12px"} ${FONT}`;
      context.fillText(String(hour === 0 ? 12 : hour), layout.left - 6, middle);
    }
  }
}

/** Spacing of station labels that are at least `least_m` apart: 1, 2 or 5 times a power of ten. */
export function step_m(least_m: number): number {
  const ten = 10 ** Math.floor(Math.log10(least_m));
  return [1, 2, 5, 10].map((times) => times * ten).find((step) => step >= least_m - 1e-9) ?? 10 * ten;
}

function stations(context: CanvasRenderingContext2D, view: View, layout: Layout): void {
  const step = step_m((view.span_m / layout.width) * 84), decimals = step < 1 ? Math.ceil(-Math.log10(step)) : 1;
  context.font = `13px ${FONT}`;
  context.textAlign = "center";
  context.fillStyle = context.strokeStyle = colour("ink");
  for (let x_m = Math.ceil(left_m(view) / step) * step; x_m <= right_m(view); x_m += step) {
    const x = across(view, layout, x_m), y = layout.top + layout.height;
    context.globalAlpha = 0.8;
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(x, y + 5);
    context.stroke();
    context.globalAlpha = 1;
    if (x > layout.left + 20 && x < layout.left + layout.width - 20) context.fillText(station(x_m, decimals), x, y + 14);
  }
}

function holes(context: CanvasRenderingContext2D, store: Store, view: View, layout: Layout, round: Round, { held }: Row): void {
  const { sections, hello } = store;
  const perMetre = layout.width / view.span_m;
  if (!hello || perMetre * hello.target_m < 9) return;
  const first = Math.max(sections.least, Math.floor(left_m(view) / hello.section_m) - 4);
  const last = Math.min(sections.most, Math.ceil(right_m(view) / hello.section_m) + 4);
  const near = Math.max(1, Math.round(hello.target_m / hello.section_m));
  context.lineWidth = 2;
  context.font = `bold 12px ${FONT}`;
  context.textAlign = "center";
  for (let index = first; index <= last; index += 1) {
    const slot = sections.slot(index);
    if (slot < 0) continue;
    const verdict = sections.verdictOf(slot, held), d = sections.hole[slot] ?? NaN;
    if ((verdict !== FAIL && verdict !== CANNOT_SAY) || !(d > 0)) continue;
    // Neighbouring sections report the same hole, so only the largest hole within the width of a circle is drawn.
    let largest = true;
    for (let other = index - near; other <= index + near && largest; other += 1) {
      const beside = sections.slot(other), its = beside < 0 ? 0 : (sections.hole[beside] ?? 0);
      largest = !(its > d || (its === d && other < index));
    }
    if (!largest) continue;
    const down = downOf(round, (sections.holeArc[slot] ?? 0) / hello.perimeter_m);
    const x = across(view, layout, sections.holeX[slot] ?? 0);
    for (const turn of [-1, 0, 1]) {
      const y = layout.top + heightOf(view, down + turn) * layout.height;
      const radiusDown = ((d / 2) * layout.height * view.zoomDown) / hello.perimeter_m;
      if (y < layout.top - radiusDown || y > layout.top + layout.height + radiusDown) continue;
      context.strokeStyle = colour("wall-dot");
      context.lineWidth = 4;
      context.beginPath();
      context.ellipse(x, y, (d / 2) * perMetre, radiusDown, 0, 0, 2 * Math.PI);
      context.stroke();
      context.strokeStyle = colour("wall-fresh");
      context.lineWidth = 1.5;
      context.stroke();
      if (perMetre * d > 26) label(context, `${figure(d, 2)} m`, x, y, colour("wall-fresh"), colour("wall-dot"));
    }
  }
  context.lineWidth = 1;
}

function label(context: CanvasRenderingContext2D, text: string, x: number, y: number, ink: string, halo: string): void {
  context.lineJoin = "round";
  context.strokeStyle = halo;
  context.lineWidth = 4;
  context.strokeText(text, x, y);
  context.lineWidth = 1;
  context.fillStyle = ink;
  context.fillText(text, x, y);
}

/** Marks the missed stretch of each alert with a pointer and the alert's number, at the top. */
function missed(context: CanvasRenderingContext2D, store: Store, view: View, layout: Layout): void {
  context.font = `bold 12px ${FONT}`;
  context.textAlign = "center";
  for (const alert of store.alerts.values()) {
    if (alert.from_m === null || alert.state !== "active" || alert.class !== "coverage") continue;
    const middle_m = (alert.from_m + (alert.to_m ?? alert.from_m)) / 2;
    if (middle_m < left_m(view) || middle_m > right_m(view)) continue;
    const x = across(view, layout, middle_m), y = layout.top;
    context.fillStyle = colour("red");
    context.beginPath();
    context.moveTo(x, y + 14);
    context.lineTo(x - 9, y);
    context.lineTo(x + 9, y);
    context.closePath();
    context.fill();
    context.strokeStyle = colour("wall-fresh");
    context.lineWidth = isUnacknowledged(alert) ? 2 : 1;
    context.stroke();
    context.lineWidth = 1;
    if ((layout.width / view.span_m) * 30 > 14) label(context, `${alert.number}`, x, y + 22, colour("wall-fresh"), colour("wall-dot"));
  }
}

function drawVehicle(context: CanvasRenderingContext2D, view: View, layout: Layout, vehicle: Vehicle): void {
  const x = across(view, layout, vehicle.at_m), { top, height } = layout;
  const spread = (2 * vehicle.sd_m * layout.width) / view.span_m;
  context.fillStyle = colour("vehicle");
  if (spread > 2) {
    context.globalAlpha = 0.18;
    context.fillRect(x - spread, top, 2 * spread, height);
    context.globalAlpha = 1;
  }
  context.strokeStyle = colour("wall-dot");
  context.lineWidth = 4;
  line(context, x, top, x, top + height);
  context.strokeStyle = colour("vehicle");
  context.lineWidth = 2;
  if (!vehicle.sure) context.setLineDash([6, 6]);
  line(context, x, top, x, top + height);
  context.setLineDash([]);
  const y = top + height / 2, d = vehicle.direction;
  context.beginPath();
  context.moveTo(x + d * 18, y);
  context.lineTo(x - d * 10, y - 12);
  context.lineTo(x - d * 4, y);
  context.lineTo(x - d * 10, y + 12);
  context.closePath();
  context.lineWidth = 3;
  context.strokeStyle = colour("wall-dot");
  context.stroke();
  context.fillStyle = colour("vehicle");
  context.fill();
  context.lineWidth = 1;
  context.font = `bold 14px ${FONT}`;
  context.textAlign = x > layout.left + layout.width - 120 ? "right" : "left";
  const text = vehicle.sure ? station(vehicle.at_m, 1) : `${station(vehicle.at_m, 1)} ?`;
  label(context, text, x + (context.textAlign === "right" ? -8 : 8), top + height - 12, colour("vehicle"), colour("wall-dot"));
}

function line(context: CanvasRenderingContext2D, x: number, y: number, to: number, down: number): void {
  context.beginPath();
  context.moveTo(x, y);
  context.lineTo(to, down);
  context.stroke();
}

/** Draws over the strip of the whole tunnel: the part visible above, the tunnel's end, and the vehicle. */
function drawStrip(
  context: CanvasRenderingContext2D, store: Store, view: View, strip: View, layout: Layout, vehicle: Vehicle | null,
): void {
  const { left, width, stripTop, stripHeight } = layout;
  const at = (x_m: number): number => left + ((x_m - left_m(strip)) / strip.span_m) * width;
  context.strokeStyle = colour("grid");
  context.strokeRect(left + 0.5, stripTop + 0.5, width - 1, stripHeight - 1);
  const from = at(left_m(view)), to = at(right_m(view));
  context.strokeStyle = colour("ink");
  context.lineWidth = 2;
  context.strokeRect(Math.max(left + 1, Math.min(from, to - 6)), stripTop + 1, Math.min(Math.max(6, to - from), width - 2), stripHeight - 2);
  context.lineWidth = 1;
  if (vehicle) {
    const x = at(vehicle.at_m);
    context.fillStyle = colour("vehicle");
    context.beginPath();
    context.moveTo(x, stripTop + stripHeight);
    context.lineTo(x - 7, stripTop + stripHeight + 9);
    context.lineTo(x + 7, stripTop + stripHeight + 9);
    context.closePath();
    context.fill();
  }
  context.font = `12px ${FONT}`;
  context.fillStyle = colour("faint");
  context.textAlign = "left";
  const y = stripTop + stripHeight + 9;
  if (!vehicle || at(vehicle.at_m) > left + 60) context.fillText(station(left_m(strip)), left, y);
  context.textAlign = "right";
  const end = store.hello?.length_m;
  if (end && (!vehicle || at(vehicle.at_m) < left + width - 60)) context.fillText(station(right_m(strip)), left + width, y);
}
