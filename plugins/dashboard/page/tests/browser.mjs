// Debian's Chromium by its path, with WebGL2 in software.
import { chromium } from "playwright-core";

export const EXECUTABLE = process.env.CHROMIUM ?? "/usr/bin/chromium";

/** A humming microphone that any page gets without a question. */
export const MICROPHONE = ["--use-fake-device-for-media-stream", "--use-fake-ui-for-media-stream"];

const opened = new Set();

export async function browser(more = []) {
  const started = await chromium.launch({
    executablePath: EXECUTABLE,
    args: ["--headless", "--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic",
      "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync", ...more],
  });
  opened.add(started);
  started.once("disconnected", () => opened.delete(started));
  return started;
}

/** Closes all open browsers, including those of a failed test, which would otherwise keep the tests from ending. */
export async function closeAll() {
  for (const started of opened) await started.close();
}

/** An `init` of `open`: the page draws no wall. Drawn in software, its frames delay clicks and clocks on a busy machine. */
export const withoutWebGl = (page) => page.addInitScript(() => {
  const get = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...rest) { return kind === "webgl2" ? null : get.call(this, kind, ...rest); };
});

/** A page in its own context; `problems` collects its messages and errors. */
export async function open(chromium, url, { width = 1280, height = 800, palette = "dusk", init, ...more } = {}) {
  const context = await chromium.newContext({ viewport: { width, height }, ...more });
  await context.addInitScript((palette) => {
    if (localStorage.getItem("headrace.page") === null) localStorage.setItem("headrace.page", JSON.stringify({ palette }));
  }, palette);
  const page = await context.newPage();
  if (init) await init(page);
  const problems = [];
  page.on("pageerror", (error) => problems.push(String(error)));
  page.on("console", (message) => { if (message.type() === "error" && !/Failed to load resource|WebSocket connection/.test(message.text())) problems.push(message.text()); });
  await page.goto(url);
  return { page, context, problems };
}
