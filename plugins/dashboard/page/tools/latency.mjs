// Latency from a change of an alert in the loop to the frame that shows it: node tools/latency.mjs PROGRAM [rounds]
// It replays logs of tests/golden at real speed to a page in Chromium on loopback. Time 0 is the tick of the alert. Its clock time is
// taken from the line of `--json-lines` that arrived soonest after its own tick, so the figure is too small by that line's delay. The end
// is the task after the frame in which the page shows the alert's new state.
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";
import { fileURLToPath } from "node:url";
import { browser, open } from "../tests/browser.mjs";

const [program, rounds = "3"] = process.argv.slice(2);
const LOGS = ["too-fast", "slipping-cable", "stalls"];
/** A replay with a page continues after its last line until it is ended; then no data arrive for longer than this, ms. */
const OVER_MS = 3000;
const golden = (name) => fileURLToPath(new URL(`../../../../tests/golden/${name}`, import.meta.url));

/** In the page: first display of each alert in each of its states, ms since 1970. */
function watch() {
  globalThis.shown = {};
  const look = () => {
    for (const alert of document.querySelectorAll(".alert[data-number]")) {
      const key = `${alert.dataset.number} ${alert.dataset.state}`;
      if (key in globalThis.shown) continue;
      globalThis.shown[key] = null;
      requestAnimationFrame(() => setTimeout(() => { globalThis.shown[key] = performance.timeOrigin + performance.now(); }));
    }
  };
  new MutationObserver(look).observe(document, { subtree: true, childList: true, attributes: true });
}

/** Latencies of one dive's changes, ms. */
async function dive(chromium, name, folder) {
  const args = ["replay", golden(`${name}.mcap`), "--speed", "1x", "--json-lines", "--page=127.0.0.1:0"];
  const child = spawn(program, args, { cwd: folder, stdio: ["ignore", "pipe", "pipe"] });
  let said = "";
  const url = new Promise((resolve, reject) => {
    child.stderr.on("data", (bytes) => {
      said += bytes;
      const found = /http:\/\/127\.0\.0\.1:\d+/.exec(said);
      if (found) resolve(found[0]);
    });
    child.once("exit", (code) => reject(new Error(`the program ended with ${code}: ${said}`)));
  });
  let begun = Infinity;
  const changes = new Map();
  let over = setTimeout(() => child.kill(), 60_000);
  const ended = (async () => {
    for await (const line of createInterface({ input: child.stdout })) {
      const now = performance.timeOrigin + performance.now();
      const state = JSON.parse(line);
      clearTimeout(over);
      over = setTimeout(() => child.kill(), OVER_MS);
      if (state.now_s === undefined) continue;
      begun = Math.min(begun, now - 1000 * state.now_s);
      for (const alert of state.alert_list ?? []) {
        const key = `${alert.number} ${alert.state}`;
        const at_s = alert.state === "active" ? alert.since_s : alert.rectified_s ?? alert.cleared_s;
        if (!changes.has(key) && at_s !== null) changes.set(key, at_s);
      }
    }
  })();
  const { page, context } = await open(chromium, await url, { init: (page) => page.addInitScript(watch) });
  await ended;
  const shown = await page.evaluate(() => globalThis.shown);
  await context.close();
  return [...changes].filter(([key]) => shown[key]).map(([key, at_s]) => shown[key] - begun - 1000 * at_s);
}

const chromium = await browser(), folder = mkdtempSync(join(tmpdir(), "headrace-latency-"));
const all = [];
for (let round = 0; round < Number(rounds); round++) for (const name of LOGS) all.push(...await dive(chromium, name, folder));
all.sort((a, b) => a - b);
const at = (share) => all[Math.min(all.length - 1, Math.floor(share * all.length))].toFixed(0);
console.log(`${all.length} changes of alerts: median ${at(0.5)} ms, p95 ${at(0.95)} ms, longest ${at(1)} ms`);
await chromium.close();
rmSync(folder, { recursive: true });
