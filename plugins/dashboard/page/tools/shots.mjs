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
for (const widget of ["speed", "wall", "alerts"]) await shot(`widget-${widget}`, { size: [420, 300], dive: far, path: `/widget/${widget}` });
await chromium.close();
