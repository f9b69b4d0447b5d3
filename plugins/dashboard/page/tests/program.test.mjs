// The page with the program itself: HEADRACE_BIN names the binary. A simulated dive, its replay, and a rehearsal on real ports.
import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { once } from "node:events";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, describe, it } from "node:test";
import { fileURLToPath } from "node:url";
import { MICROPHONE, browser, closeAll, open, withoutWebGl } from "./browser.mjs";

const BIN = process.env.HEADRACE_BIN;
const SCENE = fileURLToPath(new URL("../../../../deploy/scenes/rehearsal.toml", import.meta.url));
const LONG = { timeout: 120_000 };

async function freePort() {
  const server = createServer();
  server.listen(0, "127.0.0.1");
  await once(server, "listening");
  const { port } = server.address();
  server.close();
  await once(server, "close");
  return port;
}

const running = new Set();
/** Starts the program; returns it with the printed address of its page. */
async function start(cwd, port, ...args) {
  const child = spawn(BIN, [...args, `--page=127.0.0.1:${port}`], { cwd, stdio: ["ignore", "pipe", "pipe"] });
  running.add(child);
  child.once("exit", () => running.delete(child));
  let said = "";
  const told = new Promise((resolve, reject) => {
    const take = (bytes) => { said += bytes; if (/page\s+http:\/\/127\.0\.0\.1:\d+/.test(said)) resolve(); };
    child.stdout.on("data", take);
    child.stderr.on("data", take);
    child.once("exit", (code) => reject(new Error(`${args[0]} ended with ${code}: ${said}`)));
  });
  await told;
  return { child, url: /http:\/\/127\.0\.0\.1:\d+/.exec(said)[0] };
}
async function stop(child, signal = "SIGKILL") {
  if (child.exitCode !== null || child.signalCode !== null) return;
  child.kill(signal);
  await once(child, "exit");
}

describe("with the program", { skip: BIN ? false : "HEADRACE_BIN isn't set", concurrency: false }, () => {
  let chromium, folder;
  before(async () => { chromium = await browser(); folder = mkdtempSync(join(tmpdir(), "headrace-page-")); });
  after(async () => {
    for (const child of running) await stop(child);
    await closeAll();
    rmSync(folder, { recursive: true, force: true });
  });

  it("raises one alert for a stretch passed too fast; its acknowledgement is in all browsers, the log and the replay", async () => {
    const out = join(folder, "demo");
    const { child, url } = await start(folder, await freePort(), "demo", "--no-open", "--out", out, "--force", "--speed", "6x");
    const one = await open(chromium, url), other = await open(chromium, url);
    await one.page.locator('.condition[data-condition="good"]').waitFor(LONG);
    assert.match(await one.page.locator(".most .value").innerText(), /0\.\d\d/);
    assert.match(await one.page.locator(".why").innerText(), /distance between turns/);
    const missed = one.page.locator('.alert.open[data-kind="missed"]');
    await missed.waitFor(LONG);
    const number = await missed.first().getAttribute("data-number");
    await other.page.locator(`.alert.open[data-number="${number}"]`).waitFor();
    await one.page.keyboard.press("n");
    await one.page.keyboard.type("by the page");
    await one.page.keyboard.press("Enter");
    await other.page.locator(".notes", { hasText: "by the page" }).waitFor();
    await one.page.locator(`.alert[data-number="${number}"]`).getByRole("button", { name: /Ack alert/ }).click();
    await other.page.locator(`.alert[data-number="${number}"]:not(.open)`, { hasText: "ack page" }).waitFor();
    // One situation gives one alert.
    assert.equal(await other.page.locator('.alert[data-kind="missed"]').count(), 1);
    await one.page.reload();
    await one.page.locator(`.alert[data-number="${number}"]:not(.open)`, { hasText: "ack page" }).waitFor();
    // Each check applies only while the dive isn't over.
    if (child.exitCode === null) await Promise.race([once(child, "exit"), one.page.locator(".word", { hasText: "DIVE ENDED" }).waitFor(LONG)]);
    assert.deepEqual([one.problems, other.problems], [[], []]);
    await stop(child, "SIGINT");
    await one.context.close();
    await other.context.close();

    const port = await freePort();
    const replay = await start(folder, port, "replay", join(out, "dive.mcap"), "--speed", "8x");
    const { page, context, problems } = await open(chromium, replay.url);
    await page.locator(".replay").waitFor();
    await page.getByLabel("Time of the dive").focus();
    await page.keyboard.press("End");
    await page.locator(".notes", { hasText: "by the page" }).waitFor(LONG);
    // The pilot has gone back: the alert is acknowledged, and cleared after the new pass.
    assert.equal(await page.locator(`.alert[data-number="${number}"]`).count(), 0);
    const report = JSON.parse(execFileSync(BIN, ["replay", join(out, "dive.mcap"), "--json"], { maxBuffer: 1 << 28 }));
    const alert = report.alert_list.find((alert) => alert.number === Number(number));
    assert.deepEqual([alert.kind, alert.state, alert.acknowledged?.by], ["missed", "cleared", "page"]);
    assert.ok(await page.getByRole("button", { name: "Ack all" }).isDisabled());
    // The program is killed and restarted. The page reports the loss, and recovers by itself.
    await stop(replay.child);
    await page.locator(".word", { hasText: "NO CONNECTION" }).waitFor();
    await start(folder, port, "replay", join(out, "dive.mcap"), "--speed", "8x");
    await page.locator('.status .link:text("connected")').waitFor(LONG);
    await page.locator(':root[data-old="false"]').waitFor(LONG);
    assert.deepEqual(problems, []);
    await context.close();
  });

  it("shows a voice note of one browser in the other browser, in the log and in the replay", async () => {
    const out = join(folder, "spoken");
    const { child, url } = await start(folder, await freePort(), "demo", "--no-open", "--out", out, "--force", "--speed", "4x");
    const hears = await browser(MICROPHONE);
    const one = await open(hears, url, { init: withoutWebGl }), other = await open(chromium, url, { init: withoutWebGl });
    await one.page.locator('.condition[data-condition="good"]').waitFor(LONG);
    await one.page.locator(".notes .voice").click();
    await one.page.locator(".notes .voice.recording", { hasText: /End 0:(0[2-9]|1\d)/ }).waitFor();
    await one.page.locator(".notes .voice").click();
    // The recording's length depends on this machine. The test waited for two seconds.
    const line = other.page.locator(".notes li", { hasText: /voice, \d+ s/ });
    await line.waitFor();
    const seconds = Number(/voice, (\d+) s/.exec(await line.innerText())[1]);
    assert.ok(seconds >= 2 && seconds < 30, `${seconds} s`);
    const played = async (page, line) => {
      await line.getByRole("button", { name: /Play note 1/ }).click();
      await line.locator('.play[aria-pressed="true"]').waitFor();
      await line.locator('.play[aria-pressed="false"]').waitFor();
      assert.equal(await page.locator(".said.refused").count(), 0);
    };
    await played(other.page, line);
    assert.deepEqual([one.problems, other.problems], [[], []]);
    await stop(child, "SIGINT");
    await one.context.close();
    await other.context.close();
    await hears.close();

    const log = join(out, "dive.mcap"), voices = join(folder, "voices");
    const told = JSON.parse(execFileSync(BIN, ["notes", log, "--out", voices, "--json"], { encoding: "utf8" }));
    const [note] = told.notes;
    assert.equal(note.recording.media_type, "audio/webm");
    assert.equal(note.voice.seconds, seconds);
    const sound = readFileSync(join(voices, "note-1.webm"));
    assert.equal(sound.length, note.recording.bytes);
    // Opus in WebM, a few kB per second.
    assert.ok(sound.subarray(0, 4).equals(Buffer.from([0x1a, 0x45, 0xdf, 0xa3])) && sound.includes("A_OPUS"));
    assert.ok(sound.length > 500 * seconds && sound.length < 10_000 * (seconds + 1), `${sound.length} bytes in ${seconds} s`);

    const replay = await start(folder, await freePort(), "replay", log, "--speed", "8x");
    const { page, context, problems } = await open(chromium, replay.url, { init: withoutWebGl });
    const again = page.locator(".notes li", { hasText: `voice, ${note.voice.seconds} s` });
    await again.waitFor(LONG);
    await played(page, again);
    const fetched = await page.evaluate(async (id) => [...new Uint8Array(await (await fetch(`/voice/${id}`)).arrayBuffer())], note.voice.id);
    assert.ok(sound.equals(Buffer.from(fetched)), "the replay plays what the log has");
    assert.deepEqual(problems, []);
    await stop(replay.child);
    await context.close();
  });

  it("shows sensors that fall silent in a rehearsal within 2 s", async () => {
    const out = join(folder, "rehearsal");
    const emulator = spawn(BIN, ["emulate", SCENE, "--out", out], { stdio: ["ignore", "pipe", "ignore"] });
    running.add(emulator);
    const vehicle = join(out, "vehicle.toml");
    // The emulator prints the devices' ports last. By then all ports are open and the vehicle file is written.
    await once(emulator.stdout, "data");
    const { child, url } = await start(folder, await freePort(), "run", vehicle);
    const { page, context, problems } = await open(chromium, url);
    await page.waitForFunction(() => document.querySelectorAll('.sensor[data-state="ok"]').length >= 8, null, LONG);
    await stop(emulator);
    const killed = Date.now();
    await page.locator('.sensor[data-state="silent"]').first().waitFor();
    console.log(`# silent sensor on the page ${((Date.now() - killed) / 1000).toFixed(1)} s after it was killed (2 s of silence make it so)`);
    await page.locator(".word", { hasText: /OLD|NO SONAR|NO POSITION/ }).waitFor();
    assert.match(await page.locator('.sensor[data-state="silent"]').first().innerText(), /silent \d+\.\d s/);
    assert.deepEqual(problems, []);
    await stop(child, "SIGINT");
    await context.close();
  });
});
