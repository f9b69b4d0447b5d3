// Draws the cross-section, seen looking inwards: the tunnel's left is on the left.
import type { Echosounder } from "../feed/types";
import type { Store } from "../store/store";
import type { Return } from "../store/turns";
import { figure } from "../text/format";
import { isClose, isFresh, sideOf } from "./walls";
import { colour } from "../ui/colours";

const FONT = "system-ui, 'DejaVu Sans', sans-serif";
/** Half width and half height of the drawn vehicle, m. */
const VEHICLE = [0.35, 0.22] as const;

interface Frame { context: CanvasRenderingContext2D; x: (y_m: number) => number; y: (z_m: number) => number; scale: number }

export function drawSection(context: CanvasRenderingContext2D, store: Store, width: number, height: number): void {
  context.clearRect(0, 0, width, height);
  const { hello, state } = store;
  if (!hello || hello.profile.length === 0) return;
  const ys = hello.profile.map(([y]) => y), zs = hello.profile.map(([, z]) => z);
  const spanY = Math.max(...ys) - Math.min(...ys), spanZ = Math.max(...zs) - Math.min(...zs);
  const margin = 30, scale = Math.min((width - 2 * margin) / spanY, (height - 2 * margin) / spanZ);
  const midY = (Math.max(...ys) + Math.min(...ys)) / 2, midZ = (Math.max(...zs) + Math.min(...zs)) / 2;
  const frame: Frame = { context, scale, x: (y_m) => width / 2 - (y_m - midY) * scale, y: (z_m) => height / 2 - (z_m - midZ) * scale };
  profile(frame, hello.profile);
  clocks(frame, hello.profile, hello.clock_arc_m, hello.perimeter_m);
  const pose = state?.pose ?? null;
  if (pose) hello.heads.forEach((head) => hidden(frame, head.hidden_deg, pose, spanZ));
  store.turns.heads.forEach((turns) => {
    returns(frame, turns.last, false);
    returns(frame, turns.present, true);
  });
  if (!pose) {
    text(frame, "no position", width / 2, height / 2, "bold 16px", colour("ink"));
    return;
  }
  store.turns.heads.forEach((turns, head) => {
    const sensor = state?.sensors.find((each) => each.id === hello.heads[head]?.id);
    const latest = turns.present.at(-1);
    if (latest && sensor?.state !== "silent" && sensor?.state !== "never") direction(frame, pose, latest, head, hello.profile);
  });
  const echosounders = state?.echosounders ?? [];
  echosounders.forEach((echo) => beam(frame, echo));
  vehicle(frame, pose);
  // Labels are drawn after the vehicle, because those of short beams lie on it.
  echosounders.forEach((echo) => distance(frame, echo));
}

function profile({ context, x, y }: Frame, points: [number, number][]): void {
  context.beginPath();
  points.forEach(([py, pz], at) => (at === 0 ? context.moveTo(x(py), y(pz)) : context.lineTo(x(py), y(pz))));
  context.closePath();
  context.fillStyle = colour("water");
  context.fill();
  context.strokeStyle = colour("faint");
  context.lineWidth = 1.5;
  context.stroke();
  context.lineWidth = 1;
}

function clocks(frame: Frame, points: [number, number][], clock_arc_m: number[], perimeter_m: number): void {
  const centre = points.reduce(([sy, sz], [py, pz]) => [sy + py / points.length, sz + pz / points.length], [0, 0] as [number, number]);
  clock_arc_m.forEach((arc_m, hour) => {
    const [py, pz] = pointAt(points, arc_m / perimeter_m);
    const away = Math.hypot(py - (centre[0] ?? 0), pz - (centre[1] ?? 0)) || 1;
    const out = 14 / frame.scale / away;
    const big = hour % 3 === 0;
    text(frame, String(hour === 0 ? 12 : hour), frame.x(py + (py - (centre[0] ?? 0)) * out), frame.y(pz + (pz - (centre[1] ?? 0)) * out), big ? "bold 15px" : "11px", colour(big ? "ink" : "faint"));
  });
}

export function pointAt(points: [number, number][], share: number): [number, number] {
  const at = (share - Math.floor(share)) * points.length, low = Math.floor(at) % points.length, part = at - Math.floor(at);
  const [y0, z0] = points[low] ?? [0, 0], [y1, z1] = points[(low + 1) % points.length] ?? [0, 0];
  return [y0 + (y1 - y0) * part, z0 + (z1 - z0) * part];
}

/** Draws the angles that the vehicle hides from a head. They count from straight down to the left. Roll turns them. */
function hidden({ context, x, y, scale }: Frame, ranges: [number, number][], pose: Pose, reach_m: number): void {
  context.fillStyle = colour("hidden");
  context.globalAlpha = 0.3;
  for (const [from, to] of ranges) {
    context.beginPath();
    context.moveTo(x(pose.y_m), y(pose.z_m));
    const end = to < from ? to + 360 : to;
    for (let angle = from; angle <= end; angle += Math.max(1, (end - from) / 24)) {
      const turned = ((angle + pose.roll_deg) * Math.PI) / 180;
      context.lineTo(x(pose.y_m) - Math.sin(turned) * reach_m * 0.35 * scale, y(pose.z_m) + Math.cos(turned) * reach_m * 0.35 * scale);
    }
    context.closePath();
    context.fill();
  }
  context.globalAlpha = 1;
}

type Pose = { y_m: number; z_m: number; roll_deg: number; pitch_deg: number; yaw_deg: number };

function returns({ context, x, y }: Frame, list: Return[], present: boolean): void {
  context.fillStyle = colour(present ? "fresh" : "last");
  const half = present ? 2.2 : 1.5;
  for (const { y_m, z_m, outcome } of list) {
    if (outcome === 2 || Number.isNaN(y_m)) continue;
    const px = x(y_m), py = y(z_m);
    if (outcome === 1) {
      context.strokeStyle = colour("amber-ink");
      context.beginPath();
      context.moveTo(px - 4, py - 4);
      context.lineTo(px + 4, py + 4);
      context.moveTo(px + 4, py - 4);
      context.lineTo(px - 4, py + 4);
      context.stroke();
    } else {
      context.fillRect(px - half, py - half, 2 * half, 2 * half);
    }
  }
}

/** Draws the direction of a head's latest ping. */
function direction(frame: Frame, pose: Pose, latest: Return, head: number, points: [number, number][]): void {
  const { context, x, y } = frame;
  const [py, pz] = latest.outcome === 2 || Number.isNaN(latest.y_m) ? pointAt(points, latest.arc) : [latest.y_m, latest.z_m];
  context.strokeStyle = colour("fresh");
  context.lineWidth = latest.outcome === 0 ? 2 : 1;
  if (latest.outcome === 2) context.setLineDash([4, 4]);
  context.beginPath();
  context.moveTo(x(pose.y_m), y(pose.z_m));
  context.lineTo(x(py), y(pz));
  context.stroke();
  context.setLineDash([]);
  context.lineWidth = 1;
  const at = 0.72;
  const lx = x(pose.y_m) + (x(py) - x(pose.y_m)) * at, ly = y(pose.z_m) + (y(pz) - y(pose.z_m)) * at;
  context.fillStyle = colour("panel");
  context.beginPath();
  context.arc(lx, ly, 9, 0, 2 * Math.PI);
  context.fill();
  context.strokeStyle = colour("fresh");
  context.stroke();
  text(frame, String(head + 1), lx, ly + 0.5, "bold 12px", colour("ink"));
}

function inkOf(echo: Echosounder): string {
  return colour(!isFresh(echo) ? "faint" : isClose(echo) ? "amber-ink" : "echo");
}

function beam({ context, x, y }: Frame, echo: Echosounder): void {
  if (!echo.to) return;
  context.strokeStyle = inkOf(echo);
  context.setLineDash([2, 5]);
  context.lineWidth = 2;
  context.beginPath();
  context.moveTo(x(echo.from[0]), y(echo.from[1]));
  context.lineTo(x(echo.to[0]), y(echo.to[1]));
  context.stroke();
  context.setLineDash([]);
  context.lineWidth = 1;
}

/** Writes the distance to the wall beside the middle of the beam. */
function distance(frame: Frame, echo: Echosounder): void {
  const { from, to, range_m } = echo, side = sideOf(echo), close = isClose(echo);
  if (!to) return;
  const lx = frame.x((from[0] + to[0]) / 2), ly = frame.y((from[1] + to[1]) / 2), upright = side === "up" || side === "down";
  const words = isFresh(echo) ? `${figure(range_m, close ? 2 : 1)} m` : "silent";
  text(frame, words, lx + (upright ? 24 : 0), ly - (upright ? 0 : 10), close ? "bold 14px" : "13px", inkOf(echo), colour("water"));
}

function vehicle(frame: Frame, pose: Pose): void {
  const { context, x, y, scale } = frame;
  const w = Math.max(VEHICLE[0] * scale, 12), h = Math.max(VEHICLE[1] * scale, 8);
  context.save();
  context.translate(x(pose.y_m), y(pose.z_m));
  // Positive roll raises the vehicle's left side, because the frame is right-handed with x inwards.
  context.rotate((pose.roll_deg * Math.PI) / 180);
  context.fillStyle = colour("vehicle");
  context.strokeStyle = colour("panel");
  context.lineWidth = 2;
  context.beginPath();
  context.roundRect(-w, -h, 2 * w, 2 * h, 5);
  context.fill();
  context.stroke();
  context.beginPath();
  context.moveTo(0, -h - 8);
  context.lineTo(-5, -h - 1);
  context.lineTo(5, -h - 1);
  context.closePath();
  context.fill();
  context.restore();
  context.lineWidth = 1;
}

function text({ context }: Frame, what: string, x: number, y: number, font: string, ink: string, halo?: string): void {
  context.font = `${font} ${FONT}`;
  context.fillStyle = ink;
  context.textAlign = "center";
  context.textBaseline = "middle";
  if (halo) {
    context.strokeStyle = halo;
    context.lineWidth = 4;
    context.lineJoin = "round";
    context.strokeText(what, x, y);
    context.lineWidth = 1;
  }
  context.fillText(what, x, y);
}
