// Screenshots of the page with a mock dive, for review: node tools/shots.mjs OUT [name part]
import { mkdirSync } from "node:fs";
import { serve } from "../mock/server.mjs";
import { open, browser } from "../tests/browser.mjs";

const [out = "shots", part = ""] = process.argv.slice(2);
mkdirSync(out, { recursive: true });
const SIZES = { desk: [1280, 800], wide: [1920, 1080], phone: [390, 844] };
const chromium = await browser();

async function shot(name, { size = "desk", palette = "dusk", dive = {}, asks = [], keys = [], path = "/", full = false, wait }) {
  if (!name.includes(part)) return;
  const mock = await serve(dive);
  const [width, height] = SIZES[size] ?? size;
  const { page, context } = await open(chromium, mock.url + path, { width, height, palette });
  for (const ask of asks) mock.control(ask);
  for (const key of keys) await page.keyboard.press(key);
  await page.waitForTimeout(wait ?? 1500);
  await page.screenshot({ path: `${out}/${name}.png`, fullPage: full });
  await context.close();
  await mock.close();
}

const near = { length_m: 7000, at_m: 20 }, far = { length_m: 7000, at_m: 6866 };
for (const size of ["desk", "wide", "phone"]) {
  for (const palette of ["day", "dusk", "night"]) {
    await shot(`${size}-${palette}-20m`, { size, palette, dive: near });
    await shot(`${size}-${palette}-7km`, { size, palette, dive: far, keys: ["0"] });
  }
}
await shot("fast-missed", { dive: far, asks: [{ speed_mps: 0.41 }, { missed_m: 6849 }], wait: 1800 });
await shot("fast-missed-night", { dive: far, palette: "night", asks: [{ speed_mps: 0.41 }, { missed_m: 6849 }] });
await shot("fast-missed-phone", { dive: far, size: "phone", palette: "day", asks: [{ speed_mps: 0.41 }, { missed_m: 6849 }], full: true });
await shot("missed-close", { dive: far, palette: "day", keys: ["g", "+", "+", "+"] });
await shot("samples-close", { dive: far, keys: ["+", "+", "+", "+", "+", "]", "]"] });
await shot("no-position", { dive: far, asks: [{ position: "none" }] });
await shot("no-connection", { dive: far, asks: [{ closed: true }], wait: 3500 });
await shot("old", { dive: far, asks: [{ mute: true }], wait: 3500 });
await shot("killed-head", { dive: far, asks: [{ kill: "aft_port" }], wait: 3500 });
await shot("no-speed", { dive: near, asks: [{ condition: "no_speed", lamp: "red", remedy: "set the heads to SLOW" }, { world: { v_max_mps: null } }] });
await shot("replay", { dive: { ...far, mode: "replay" }, asks: [{ world: { playback: { paused: true, speed: 4 } } }] });
await shot("tablet", { size: [1024, 768], dive: far });
await shot("help", { dive: near, keys: ["?"] });
await shot("token", { dive: { ...near, token: "abc" }, wait: 800 });
const ended = [{ world: { over: { outstanding: "5.50 m missed, from 6+856.75" }, legs: [{ from_m: 6862.25, to_m: 6856.75, at_most_mps: 0.0925, why: "too_fast" }] } },
  { end: { summary: { pass_m: 6851.25, fail_m: 5.5, cannot_say_m: 7, not_inspected_m: 2.25, open_m: 0 }, way: { length_m: 6866 } } }];
for (const size of ["desk", "wide", "phone"]) await shot(`ended-${size}`, { size, dive: far, asks: ended });
await shot("ended-closed", { dive: far, asks: [...ended, { closed: true }], wait: 4000 });
const back = { legs: [{ from_m: 16.25, to_m: 10.75, at_most_mps: 0.0925, why: "too_fast" }, { from_m: 8.6, to_m: 8.3, at_most_mps: 0.119, why: "not_passed" }] };
const plan = { fits: "fits in the 1 h 20 min left", all_fits: true, steps: [
  { kind: "go", text: "back to 0+008.2 at any speed", from_m: 20, to_m: 8.2 },
  { kind: "inspect", text: "inspect 0+008.2 to 0+018.8 at most 0.092 m/s", from_m: 8.2, to_m: 18.8 },
  { kind: "go_on", text: "go on from 0+020.0", from_m: 20, to_m: 60 }] };
const going = { world: { ...back, condition: "going_back", speed_mps: -0.2, over: { plan, outstanding: "5.50 m missed, from 0+010.75",
  speeds: { speed: "0.200", limit: null, margin: null }, echosounders: [{ id: "echo_right", range_m: 0.42, age_s: 0.1, from: [-2, 3], to: [-2.42, 3.05] }] } } };
const slow = { speeds: { speed: "0.106", limit: "0.094", margin: "0.012 too fast" } };
await shot("digits", { dive: near, asks: [{ world: { speed_mps: -0.106, v_max_mps: 0.094, condition: "too_fast", lamp: "red", remedy: "set the heads to FASTER: 0.13 m/s", over: slow } }] });
for (const size of ["desk", "wide", "phone"]) await shot(`back-${size}`, { size, dive: near, asks: [going], full: size === "phone" });
for (const widget of ["speed", "wall", "alerts"]) await shot(`widget-${widget}`, { size: [420, 300], dive: far, path: `/widget/${widget}` });
await chromium.close();
