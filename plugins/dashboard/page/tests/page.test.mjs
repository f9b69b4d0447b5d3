// The page with a mock dive, in Debian's Chromium. Tests never sleep, but wait for conditions.
import assert from "node:assert/strict";
import { after, before, describe, it } from "node:test";
import { readFileSync } from "node:fs";
import { deflateRawSync } from "node:zlib";
import { createServer } from "node:http";
import { serve } from "../mock/server.mjs";
import { samplesBetween, samplesFrame, sectionsFrame } from "../mock/dive.mjs";
import { World } from "../mock/world.mjs";
import { MICROPHONE, browser, open, withoutWebGl } from "./browser.mjs";

const AXE = readFileSync(new URL("../node_modules/axe-core/axe.min.js", import.meta.url), "utf8");
let chromium;
before(async () => { chromium = await browser(); });
after(async () => { await chromium.close(); });

/** Runs a test with a dive and a page, and closes both. */
async function on(options, run, { path = "/", ...more } = {}) {
  const mock = await serve({ length_m: 7000, at_m: 60, ...options });
  const opened = await open(chromium, mock.url + path, more);
  try {
    await run({ mock, ...opened, again: (over) => open(chromium, mock.url + path, over) });
    assert.deepEqual(opened.problems, []);
  } finally {
    await opened.context.close();
    await mock.close();
  }
}
const word = (page, text) => page.locator(".condition .word", { hasText: text }).waitFor();

/** Number of pixels within 24 of a colour in each component. */
const countNear = (page, picture, colour) => page.evaluate(async ({ base64, colour }) => {
  const bitmap = await createImageBitmap(new Blob([Uint8Array.from(atob(base64), (each) => each.charCodeAt(0))]));
  const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
  context.drawImage(bitmap, 0, 0);
  const { data } = context.getImageData(0, 0, bitmap.width, bitmap.height);
  let count = 0;
  for (let at = 0; at < data.length; at += 4) if (colour.every((part, n) => Math.abs(data[at + n] - part) < 24)) count += 1;
  return count;
}, { base64: picture.toString("base64"), colour });
const condition = (page, name) => page.locator(`.condition[data-condition="${name}"]`).waitFor();


describe("display", () => {
  it("shows v_max with its reason, and the wall", () => on({}, async ({ page }) => {
    await condition(page, "good");
    assert.match(await page.locator(".most .value").innerText(), /0\.24/);
    assert.match(await page.locator(".why").innerText(), /distance between turns/);
    assert.match(await page.locator(".chainage").innerText(), /^0\+06\d\.\d$/);
    // The stretch from 0+012 to 0+018 was missed: holes over T are yellow, its outline is red, and the rest is blue to grey.
    await page.waitForFunction(() => !document.querySelector(".condition.old"));
    const near = async (colour) => countNear(page, await page.screenshot({ clip: await page.locator(".wall-box").boundingBox() }), colour);
    let yellow = 0;
    for (let tries = 0; tries < 20 && yellow < 300; tries += 1) yellow = await near([0xfe, 0xe8, 0x38]);
    assert.ok(yellow >= 300, `${yellow} yellow pixels on the wall`);
    assert.ok(await near([0xff, 0x4d, 0x3d]) >= 100, "no outline of what is flagged");
    assert.ok(await near([0x57, 0x5d, 0x6d]) >= 2000, "no wall that passes");
  }));

  it("shows a faster option if slower won't help", () => on({}, async ({ mock, page }) => {
    mock.control({ condition: "no_speed", lamp: "red", remedy: "set the heads to SLOW" });
    await condition(page, "no_speed");
    assert.match(await page.locator(".remedy").innerText(), /set the heads to SLOW/);
    assert.match(await page.locator(".condition .advice").innerText(), /set the heads to SLOW/);
  }));

  it("shows a lost position", () => on({}, async ({ mock, page }) => {
    await condition(page, "good");
    mock.control({ position: "none" });
    await word(page, "NO POSITION");
    assert.match(await page.locator(".chainage").innerText(), /no position/);
    assert.match(await page.locator(".sure").innerText(), /heading unknown/);
  }));

  it("shows a silent sensor within 2 s, with its age", () => on({}, async ({ mock, page }) => {
    await page.locator('[data-sensor="aft_port"][data-state="ok"]').waitFor();
    mock.control({ kill: "aft_port" });
    await page.locator('[data-sensor="aft_port"][data-state="silent"]').waitFor({ timeout: 4000 });
    assert.match(await page.locator('[data-sensor="aft_port"]').innerText(), /silent [2-4]\.\d s/);
    await page.locator('.alert[data-kind="sensor_silent"]').waitFor();
  }));

  it("shows a failed recording", () => on({}, async ({ mock, page }) => {
    mock.control({ recording: { on: true, fails: true, words: "NOT RECORDED", path: "dive.mcap" } });
    await page.locator(".recording", { hasText: "NOT RECORDED" }).waitFor();
  }));

  it("serves each widget at its path", async () => {
    for (const [path, there] of [["speed", ".gauge"], ["wall", ".wall-box canvas"], ["alerts", ".alert-list"]]) {
      await on({}, async ({ page }) => {
        await page.locator(there).first().waitFor();
        assert.equal(await page.locator(".status").count(), 0);
        const fits = await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth && document.documentElement.scrollHeight <= innerHeight);
        assert.ok(fits, `/widget/${path} doesn't fit its frame`);
      }, { path: `/widget/${path}`, width: 420, height: 300 });
    }
  });

  it("works below a path that a proxy adds", async () => {
    for (const path of ["/extension/headrace/", "/extension/headrace/widget/wall"]) {
      await on({ below: "/extension/headrace" }, async ({ page }) => {
        await page.waitForFunction(() => performance.getEntriesByType("resource").some(({ name }) => name.includes("/extension/headrace/samples?")));
      }, { path });
    }
  });

  it("shows everything except the wall without WebGL2", () => on({}, async ({ page }) => {
    await page.locator(".missing", { hasText: "no WebGL2" }).waitFor();
    await condition(page, "good");
  }, { init: withoutWebGl }));
});

describe("one truth", () => {
  const legs = [{ from_m: 16.25, to_m: 10.75, at_most_mps: 0.0925, why: "too_fast" }, { from_m: 8.6, to_m: 8.3, at_most_mps: 0.119, why: "not_passed" }];
  const fits = (page, within) => page.evaluate((within) => [...document.querySelectorAll(within)]
    .filter((each) => each.scrollWidth > each.clientWidth + 1).map((each) => each.textContent), within);

  it("shows missed sections beside a green lamp", () => on({}, async ({ mock, page }) => {
    await condition(page, "good");
    mock.control({ world: { over: { outstanding: "5.50 m missed, from 0+010.75" } } });
    await page.locator(".condition.green .outstanding", { hasText: "5.50 m missed, from 0+010.75" }).waitFor();
    mock.control({ world: { over: { outstanding: null } } });
    await page.locator(".condition .outstanding").waitFor({ state: "detached" });
  }, { init: withoutWebGl }));

  it("shows them in the widget, too", () => on({ at_m: 300 }, async ({ mock, page }) => {
    mock.control({ world: { over: { outstanding: "5.50 m missed, from 0+010.75" } } });
    await page.locator(".outstanding").waitFor();
    const room = await page.evaluate(() => {
      const bottom = (name) => document.querySelector(name).getBoundingClientRect().bottom;
      return [bottom(".condition") - bottom(".outstanding"), innerHeight - bottom(".place")];
    });
    assert.ok(room.every((each) => each >= 0), `${room}`);
  }, { path: "/widget/speed", width: 420, height: 300 }));

  it("shows the same ready speed texts in the panel and in the advice, and nothing is cut at 1280 px", () => on({}, async ({ mock, page }) => {
    const speeds = { speed: "0.106", limit: "0.094", margin: "0.012 too fast" };
    mock.control({ world: { speed_mps: -0.106, v_max_mps: 0.0943, condition: "too_fast", lamp: "red", over: { speeds } } });
    await page.locator(".most .value", { hasText: /^0\.094$/ }).waitFor();
    assert.equal(await page.locator(".speed .now").innerText(), "0.106m/s back");
    assert.equal(await page.locator(".margin").innerText(), "0.012 too fast");
    assert.match(await page.locator(".condition .advice").innerText(), /at most 0\.094 m\/s$/);
    assert.deepEqual(await fits(page, ".figures, .place, .condition, .lamp"), []);
  }, { init: withoutWebGl }));

  it("shows no limit while nothing limits the speed", () => on({}, async ({ mock, page }) => {
    mock.control({ world: { condition: "going_back", speed_mps: -0.2, over: { speeds: { speed: "0.200", limit: null, margin: null } } } });
    await page.locator(".forecast", { hasText: /^nothing limits the speed on the way$/ }).waitFor();
    assert.equal(await page.locator(".speed :is(.most, .margin)").count(), 0);
    assert.doesNotMatch(await page.locator(".speed").innerText(), /max|–|limit /);
    // Conditions without a limit in which a turn is still forecast.
    mock.control({ world: { condition: "cannot_say", lamp: "amber", over: { speeds: { speed: "0.090", limit: null, margin: null } } } });
    await condition(page, "cannot_say");
    assert.equal(await page.locator(".speed :is(.most, .margin, .why b)").count(), 0);
    assert.doesNotMatch(await page.locator(".condition .advice").innerText(), /m\/s/);
  }, { init: withoutWebGl }));

  it("works without the fields that earlier versions lack", () => on({}, async ({ mock, page }) => {
    mock.control({ world: { over: { speeds: undefined, outstanding: undefined, depth_m: undefined } } });
    await condition(page, "good");
    await page.waitForFunction(() => /^0\.0\d to spare$/.test(document.querySelector(".margin")?.innerText ?? ""));
    assert.equal(await page.locator(".depth, .outstanding").count(), 0);
    mock.control({ world: { condition: "going_back" } });
    await page.locator(".speed .most").waitFor({ state: "detached" });
    mock.control({ world: { over: { metres: { pass_m: 40, fail_m: 5.5, cannot_say_m: 0, open_m: 0, not_inspected_m: 0, way_m: 45.5 }, outstanding: undefined } } });
    await page.locator(".condition .outstanding", { hasText: /^5\.50 m missed$/ }).waitFor();
  }, { init: withoutWebGl }));

  for (const [width, height] of [[1280, 800], [390, 844]]) {
    it(`lists the way back rounded outward, in large type that is not cut, at ${width} px`, () => on({}, async ({ mock, page }) => {
      mock.control({ world: { legs } });
      const first = page.locator(".back .leg").first();
      await first.filter({ hasText: "0+016.3–0+010.7 ≤ 0.092 m/s too fast" }).waitFor();
      assert.equal(await first.getAttribute("title"), "0+016.25–0+010.75");
      assert.equal(await page.locator(".back .count").innerText(), "2 stretches, 12.5 m, 2 min 20 s");
      assert.match(await page.locator(".back .leg").nth(1).innerText(), /0\+008\.6–0\+008\.3\s+≤ 0\.11 m\/s not passed/);
      assert.ok(await first.evaluate((leg) => Number.parseFloat(getComputedStyle(leg).fontSize)) >= 18);
      assert.deepEqual(await fits(page, ".back .leg, .back .leg *, .back .panel-head, .result, .place"), []);
      // Without a speed there is no time.
      mock.control({ world: { legs: [{ ...legs[0], at_most_mps: null }] } });
      await page.locator(".back .count", { hasText: /^12\.5 m$/ }).waitFor();
    }, { init: withoutWebGl, width, height }));
  }

  for (const [width, height] of [[1280, 800], [390, 844]]) {
    it(`shows the next three steps of the plan, the first one largest, at ${width} px`, () => on({}, async ({ mock, page }) => {
      const step = (text, from_m, to_m) => ({ text, from_m, to_m });
      const steps = [step("back to 0+008.2 at any speed", 20, 8.2), step("inspect 0+008.2 to 0+018.8 at most 0.092 m/s", 8.2, 18.8),
        step("go on from 0+020.0", 20, 60)];
      mock.control({ world: { legs, over: { plan: { steps, fits: "fits in the 1 h 20 min left", all_fits: true } } } });
      const shown = page.locator(".back .steps .leg");
      await shown.nth(2).filter({ hasText: "3. go on from 0+020.0" }).waitFor();
      assert.equal(await shown.count(), 3);
      assert.equal(await page.locator(".back .count").innerText(), "fits in the 1 h 20 min left");
      const sizes = await shown.evaluateAll((all) => all.map((each) => Number.parseFloat(getComputedStyle(each).fontSize)));
      assert.ok(sizes[0] >= 18 && sizes[0] > sizes[1], `${sizes}`);
      assert.deepEqual(await fits(page, ".back .leg, .back .panel-head"), []);
      const last = await page.locator(".back").evaluate((panel) => panel.getBoundingClientRect().bottom - panel.querySelector("li:last-child").getBoundingClientRect().bottom);
      assert.ok(last >= 0, `all steps are visible: ${last}`);
      mock.control({ world: { legs, over: { plan: { steps: steps.slice(0, 1), fits: "not all fits: 3.5 m missed would remain", all_fits: false } } } });
      await page.locator(".back .count.bad", { hasText: "3.5 m missed would remain" }).waitFor();
      // Without a position there is no plan, and the stretches are listed.
      mock.control({ world: { legs, over: { plan: null } } });
      await page.locator(".back .leg", { hasText: "0+016.3" }).waitFor();
    }, { init: withoutWebGl, width, height }));
  }

  it("shows dive time with UTC, depth and heading", () => on({ at_m: 60 }, async ({ mock, page }) => {
    mock.control({ world: { over: { pose: { y_m: 0, z_m: 3, roll_deg: 1, pitch_deg: 2, yaw_deg: -1.26 } } } });
    await page.locator(".heading", { hasText: "heading 1.3° right" }).waitFor();
    assert.match(await page.locator(".depth").innerText(), /^depth 12\.\d m$/);
    assert.match(await page.locator(".clock").innerText(), /^dive 5:0\d\s+06:05:0\d UTC$/);
    assert.match(await page.locator(".clock time").getAttribute("title"), /^2026-08-30 06:05:0\d UTC$/);
    assert.equal(await page.locator(".attitude").innerText(), "roll 1° pitch 2°");
    const since = page.locator(".alert .since time").first();
    assert.equal(await since.innerText(), "1:31");
    assert.match(await since.getAttribute("title"), /^2026-08-30 06:01:31 UTC, 3 min \d\d s ago$/);
    await page.keyboard.press("b");
    const note = page.locator(".notes li time");
    await note.waitFor();
    assert.match(await note.innerText(), /^5:\d\d$/);
    assert.match(await note.getAttribute("title"), / UTC$/);
    assert.match(await page.locator(".notes li b").innerText(), /^0\+06\d\.\d$/);
    await page.locator(".history-box").hover();
    assert.match(await page.locator(".history-box").getAttribute("title"), /^\d:\d\d, 2026-08-30 .* UTC$/);
  }, { init: withoutWebGl }));

  it("warns of a close wall in words", () => on({}, async ({ mock, page }) => {
    const echo = (range_m) => ({ id: "echo_right", range_m, age_s: 0.1, from: [-0.2, 3], to: [-0.2 - range_m, 3.05] });
    mock.control({ world: { over: { echosounders: [echo(0.42)] } } });
    await page.locator(".close-wall", { hasText: /^WALL 0\.42 m, right$/ }).waitFor();
    mock.control({ world: { over: { echosounders: [echo(1.9)] } } });
    await page.locator(".close-wall", { hasText: /^$/ }).waitFor({ state: "hidden" });
  }, { init: withoutWebGl }));

  it("hatches sections that are not inspected in grey, on the wall and in the bar", () => on({ at_m: 3 }, async ({ page }) => {
    await condition(page, "good");
    let grey = 0;
    for (let tries = 0; tries < 20 && grey < 200; tries += 1) {
      grey = await countNear(page, await page.screenshot({ clip: await page.locator(".wall-box").boundingBox() }), [0x8c, 0x98, 0xa3]);
    }
    assert.ok(grey >= 200, `${grey} grey pixels on the wall`);
    assert.equal(await page.locator(".bar > .v-not-inspected").evaluate((bar) => getComputedStyle(bar).fill), 'url("#unpassed")');
  }));

  it("has a legend for each mark, no colour twice, and hover text that is not cut", () => on({ at_m: 60 }, async ({ page }) => {
    await condition(page, "good");
    assert.deepEqual(await page.locator(".legend .mark").allInnerTexts(),
      ["missed", "gap", "can't say", "not inspected", "open", "unseen", "sample", "doubtful", "this turn", "largest hole", "vehicle"]);
    const { yellow, notInspected } = await page.evaluate(() => ({ yellow: getComputedStyle(document.documentElement).getPropertyValue("--caution"),
      notInspected: getComputedStyle(document.querySelector(".key.v-not-inspected")).backgroundImage }));
    assert.match(notInspected, /repeating-linear-gradient/);
    assert.ok(!notInspected.includes(yellow));
    const wall = await page.locator(".wall-box").boundingBox();
    for (let x = 60; x < wall.width; x += 20) {
      await page.mouse.move(wall.x + x, wall.y + 60);
      const cut = await fits(page, ".under");
      assert.deepEqual(cut, []);
      const inside = await page.evaluate(() => document.querySelector(".under").getBoundingClientRect().bottom <= document.querySelector(".legend.marks").getBoundingClientRect().bottom);
      assert.ok(inside, await page.locator(".under").innerText());
    }
  }));
});

describe("a finished dive", () => {
  const summary = { pass_m: 48.25, fail_m: 5.5, cannot_say_m: 0.25, not_inspected_m: 2.25, open_m: 0 };
  const end = { summary, way: { length_m: 56.25 } };
  const legs = [{ from_m: 16.25, to_m: 10.75, at_most_mps: 0.0925, why: "too_fast" }];

  it("shows its result first, and nothing as if it were live", () => on({ mode: "replay" }, async ({ mock, page }) => {
    await condition(page, "good");
    mock.control({ world: { legs, over: { outstanding: "5.50 m missed, from 0+010.75" } } });
    mock.control({ world: { playback: { paused: true, speed: 1 } }, end });
    await word(page, "DIVE ENDED");
    await page.locator(".condition.ended .shape.ended").waitFor();
    assert.deepEqual(await page.locator(".result dl > div").allInnerTexts(), ["passed\n48.3 m", "missed\n5.50 m", "can't say\n0.25 m", "not inspected\n2.25 m"]);
    assert.equal(await page.locator(".result .outstanding").innerText(), "5.50 m missed, from 0+010.75");
    assert.match(await page.locator(".result li").innerText(), /^0\+016\.3–0\+010\.7 too fast$/);
    // The metres by verdict are those of the result, not of the last state.
    assert.match(await page.locator(".metres dl").first().innerText(), /passed\s+48\.3 m/);
    assert.equal(await page.locator(".speed, .paused, .shape.green, .shape.amber, .shape.red").count(), 0);
    assert.match(await page.locator(".sensors .panel-head").innerText(), /at the end/);
    const all = await page.locator("#page").innerText();
    assert.doesNotMatch(all, /Hz|recording|to spare|no connection/);
    mock.control({ closed: true });
    await page.locator(".status .link", { hasText: /^the program has closed$/ }).waitFor();
    await page.locator(':root[data-old="false"]').waitFor();
    assert.doesNotMatch(await page.locator("#page").innerText(), /no connection|tried/);
  }, { init: withoutWebGl }));

  it("counts open metres only if there are any", () => on({}, async ({ mock, page }) => {
    mock.control({ end: { ...end, summary: { ...summary, open_m: 0.5 } } });
    await page.locator(".result .open", { hasText: "0.50 m" }).waitFor();
  }, { init: withoutWebGl }));
});

describe("voice notes", () => {
  let hears;
  before(async () => { hears = await browser(MICROPHONE); });
  after(async () => { await hears.close(); });
  const voice = (page) => page.locator(".notes .voice");

  /** Runs a test with a dive and a page with a microphone. */
  async function spoken(run) {
    const mock = await serve({ length_m: 7000, at_m: 60, mode: "demo" });
    const opened = await open(hears, mock.url, { init: withoutWebGl });
    try {
      await condition(opened.page, "good");
      await run({ mock, ...opened });
      assert.deepEqual(opened.problems, []);
    } finally {
      await opened.context.close();
      await mock.close();
    }
  }

  it("is created when the recording begins, shows its seconds, and plays", () => spoken(async ({ mock, page }) => {
    await voice(page).click();
    await page.locator(".notes .voice.recording", { hasText: /End 0:0[1-9]/ }).waitFor();
    const [begun] = mock.control({}).notes;
    assert.equal(begun.voice.seconds, null);
    await page.locator(".notes li", { hasText: /voice\s+page/ }).waitFor();
    await page.keyboard.press("t");
    const line = page.locator(".notes li", { hasText: /voice, \d s/ });
    await line.waitFor();
    assert.equal(await page.locator(".notes li").count(), 1);
    const [ended] = mock.control({}).notes;
    assert.deepEqual([ended.number, ended.at_s, ended.chainage_m], [begun.number, begun.at_s, begun.chainage_m]);
    const play = line.getByRole("button", { name: /Play note 1/ });
    await play.click();
    await line.locator('.play[aria-pressed="true"]').waitFor();
    await line.locator('.play[aria-pressed="false"]').waitFor();
    assert.equal(await page.locator(".said.refused").count(), 0);
  }));

  it("ends when a held button is released", () => spoken(async ({ page }) => {
    await voice(page).hover();
    await page.mouse.down();
    await page.locator(".notes .voice.recording", { hasText: /End 0:0[1-9]/ }).waitFor();
    await page.mouse.up();
    await page.locator(".notes li", { hasText: /voice, \d s/ }).waitFor();
  }));

  it("reports that its recording can't be stored, and sends it again", () => spoken(async ({ mock, page }) => {
    mock.control({ refuses: "the voice note isn't recorded: nothing is being recorded at present" });
    await voice(page).click();
    await page.locator(".notes .voice.recording").waitFor();
    await voice(page).click();
    await page.locator(".notes .voice-words", { hasText: "the voice note isn't recorded: nothing is being recorded" }).waitFor();
    mock.control({ refuses: null });
    await page.locator(".notes .voice.unsent", { hasText: "Send again" }).click();
    await page.locator(".notes li", { hasText: /voice, \d s/ }).waitFor();
    await page.locator(".notes .voice.idle").waitFor();
    // The recording is sent automatically once the connection is back.
    await voice(page).click();
    await page.locator(".notes .voice.recording").waitFor();
    mock.control({ closed: true });
    await voice(page).click();
    await page.locator(".notes .voice.unsent").waitFor();
    mock.control({ closed: false });
    await page.locator(".notes li", { hasText: /voice, \d s/ }).nth(1).waitFor();
  }));

  it("gives the reason if the microphone, a secure page or a recorded dive is missing", async () => {
    const told = (page, words) => page.locator(".notes .voice-words", { hasText: words }).waitFor();
    await on({ mode: "demo" }, async ({ mock, page }) => {
      await condition(page, "good");
      await page.keyboard.press("t");
      await told(page, /microphone/);
      assert.equal(mock.control({}).notes.length, 0, "nothing was recorded, and nothing is noted");
      mock.control({ recording: { on: false, fails: false, path: null } });
      await page.locator(".recording", { hasText: "not recorded" }).waitFor();
      await page.keyboard.press("t");
      await told(page, /this dive isn't recorded/);
    });
    const insecure = (page) => page.addInitScript(() => Object.defineProperty(window, "isSecureContext", { value: false }));
    await on({ mode: "demo" }, async ({ page }) => {
      await page.locator(".notes .voice.lacks", { hasText: "No voice" }).waitFor();
      await voice(page).click();
      await told(page, /only for https pages/);
    }, { init: insecure });
  });
});

describe("alerts", () => {
  it("list a stretch passed too fast once; an acknowledgement in one browser appears in the other", () => on({ at_m: 148 }, async ({ mock, page, again }) => {
    await condition(page, "good");
    mock.control({ speed_mps: 0.5 });
    await condition(page, "too_fast");
    const alert = page.locator('.alert[data-kind="too_fast"]');
    await alert.waitFor();
    mock.control({ missed_m: 149 });
    const missed = page.locator(".alert", { hasText: "MISSED 0+149" });
    await missed.waitFor();
    assert.equal(await missed.count(), 1);
    assert.match(await missed.innerText(), /inspect again from 0\+147, at most 0\.08 m\/s/);
    const other = await again();
    await other.page.locator(".alert.open", { hasText: "MISSED 0+149" }).waitFor();
    await missed.getByRole("button", { name: /Ack alert/ }).click();
    await other.page.locator(".alert:not(.open)", { hasText: "MISSED 0+149" }).waitFor();
    assert.match(await other.page.locator(".alert", { hasText: "MISSED 0+149" }).innerText(), /ack page/);
    assert.deepEqual(mock.control({}).alerts.find((each) => each.from_m === 149).acknowledged.by, "page");
    await other.context.close();
  }));

  /** Fully visible items of the list, all its items, and the displayed number of hidden ones. */
  const listed = (page) => page.evaluate(() => {
    const frame = document.querySelector(".alert-list").getBoundingClientRect();
    const items = [...document.querySelectorAll(".alert")];
    const whole = items.filter((item) => item.getBoundingClientRect().top >= frame.top - 1 && item.getBoundingClientRect().bottom <= frame.bottom + 1);
    const more = document.querySelector(".alerts .more")?.textContent ?? "0";
    const root = document.documentElement;
    return { whole: whole.map((item) => Number(item.dataset.number)), all: items.length, hidden: Number.parseInt(more, 10),
      fits: root.scrollHeight <= innerHeight && root.scrollWidth <= innerWidth };
  });
  const raised = (mock, count) => {
    for (let k = 0; k < count; k += 1) mock.control({ raise: { priority: k === 3 ? "alarm" : "warning", kind: `kind_${k}`, text: `sensor ${k} has been silent for a while`, advice: "look at its plug" } });
  };

  it("show the first of twenty at 1280x800, count the rest, and reach them by keys", () => on({ at_m: 1 }, async ({ mock, page }) => {
    await page.locator(".alert-list .none").waitFor();
    raised(mock, 20);
    await page.waitForFunction(() => document.querySelectorAll(".alert").length === 20 && document.querySelector(".alerts .more"));
    const before = await listed(page);
    assert.ok(before.fits, "the page has grown over its window");
    assert.ok(before.whole.length >= 10, `${before.whole.length} of 20 can be read`);
    // The only alarm is first in the list. An item cut off by the edge may count as shown or as hidden.
    assert.equal(before.whole[0], 4);
    assert.ok([0, 1].includes(20 - before.whole.length - before.hidden), JSON.stringify(before));
    await page.locator(".alert-list").focus();
    await page.keyboard.press("End");
    await page.waitForFunction(() => !document.querySelector(".alerts .more"));
    const after = await listed(page);
    assert.ok(after.whole.length >= 10 && after.all === 20, JSON.stringify(after));
    assert.ok(!after.whole.includes(4) && after.fits, JSON.stringify(after));
    // An item with the focus opens and shows its action.
    const last = page.locator(".alert").last(), advice = last.locator(".do");
    assert.ok(!(await advice.isVisible()));
    await last.getByRole("button", { name: /Ack alert/ }).focus();
    await advice.waitFor();
    await page.locator(".alert-list").focus();
    await page.keyboard.press("Home");
    await page.waitForFunction((hidden) => Number.parseInt(document.querySelector(".alerts .more")?.textContent ?? "0", 10) === hidden, before.hidden);
  }));

  it("show the whole place of each missed stretch in a long list", () => on({ at_m: 1 }, async ({ mock, page }) => {
    for (let k = 0; k < 8; k += 1) mock.control({ raise: { priority: "alarm", class: "coverage", kind: "missed", text: `MISSED 0+0${k}0.00 to 0+0${k}6.25, at 3 o'clock: too fast` } });
    await page.locator(".dense .alert").nth(7).waitFor();
    const cut = await page.locator(".alert .text").evaluateAll((texts) => texts.filter((each) => each.scrollWidth > each.clientWidth).length);
    assert.equal(cut, 0);
  }, { init: withoutWebGl }));

  it("count alerts beyond the list; these move up as others are acknowledged", () => on({ at_m: 1 }, async ({ mock, page }) => {
    await page.locator(".alert-list .none").waitFor();
    raised(mock, 70);
    await page.waitForFunction(() => document.querySelectorAll(".alert").length === 64);
    await page.locator(".alerts .count", { hasText: "70 not acknowledged" }).waitFor();
    await page.locator(".alert-list").focus();
    await page.keyboard.press("End");
    await page.locator(".alerts .more", { hasText: /^6 more hidden$/ }).waitFor();
    for (let k = 0; k < 10; k += 1) mock.control({ settle: `kind_${k}` });
    await page.keyboard.press("Shift+A");
    await page.locator(".alerts .count", { hasText: "60 acknowledged" }).waitFor();
    await page.waitForFunction(() => document.querySelectorAll(".alert").length === 60 && !document.querySelector(".alerts .more")?.textContent.match(/hidden$/));
    assert.ok((await listed(page)).fits);
  }));

  it("keep cleared alerts until acknowledged, except cautions", () => on({}, async ({ mock, page }) => {
    await condition(page, "good");
    mock.control({ raise: { priority: "alarm", class: "coverage", kind: "missed", text: "MISSED 0+040" } });
    mock.control({ raise: { priority: "caution", class: "setting", kind: "setting_doubted", text: "setting doubted" } });
    await page.locator(".alert.caution", { hasText: "setting doubted" }).waitFor();
    mock.control({ settle: "missed" });
    mock.control({ settle: "setting_doubted" });
    await page.locator('.alert.rectified[data-kind="missed"]', { hasText: "· rectified" }).waitFor();
    await page.locator(".alert.caution").waitFor({ state: "detached" });
    await page.keyboard.press("a");
    await page.locator('.alert[data-kind="missed"]').waitFor({ state: "detached" });
  }));

  it("show the number of further alerts", () => on({}, async ({ mock, page }) => {
    await condition(page, "good");
    for (let n = 0; n < 30; n += 1) mock.control({ raise: { text: `warning ${n}`, kind: `kind_${n}` } });
    await page.locator(".alert").nth(29).waitFor();
    // Items hidden below, and items at least partly visible.
    await page.waitForFunction((all) => {
      const below = Number(/^(\d+) more hidden below/.exec(document.querySelector(".more")?.innerText ?? "")?.[1]);
      const bottom = document.querySelector(".alert-list").getBoundingClientRect().bottom;
      const inside = [...document.querySelectorAll(".alert")].filter((item) => item.getBoundingClientRect().top <= bottom - 24).length;
      return below > 0 && below + inside === all;
    }, mock.control({}).alerts.length);
  }));
});

describe("connection", () => {
  it("recovers completely from a network loss of 20 s, and counts the seconds", async () => {
    await on({ at_m: 90 }, async ({ mock, page }) => {
      await condition(page, "good");
      await page.keyboard.press("0");
      await page.clock.install();
      mock.control({ closed: true });
      mock.control({ missed_m: 80 });
      // The clock of the page runs on while nothing answers.
      await page.clock.runFor(20_000);
      await word(page, "NO CONNECTION");
      await page.locator(".condition .advice", { hasText: /for (19|2\d) s/ }).waitFor();
      await page.locator(':root[data-old="true"]').waitFor();
      await page.locator(".age", { hasText: /(19|2\d) s old/ }).waitFor();
      await page.waitForFunction(() => document.title.includes("NO CONNECTION"));
      mock.control({ closed: false });
      await page.clock.runFor(5000);
      await page.clock.resume();
      await condition(page, "good");
      await page.locator(".alert.open", { hasText: "MISSED 0+080" }).waitFor();
      await page.locator('.status .link:text("connected")').waitFor();
      await page.locator(':root[data-old="false"]').waitFor();
    });
  });

  it("shows data as old within 2 s if the program sends nothing", () => on({}, async ({ mock, page }) => {
    await condition(page, "good");
    mock.control({ mute: true });
    await word(page, "OLD");
    assert.match(await page.locator(".condition .word").innerText(), /OLD [23]\.\d s/);
    mock.control({ mute: false });
    await word(page, "GOOD");
  }));

  it("resumes after a reload, and after a restart of the program", () => on({ at_m: 90 }, async ({ mock, page }) => {
    await condition(page, "good");
    mock.control({ missed_m: 80 });
    await page.locator(".alert", { hasText: "MISSED 0+080" }).waitFor();
    await page.reload();
    await page.locator(".alert", { hasText: "MISSED 0+080" }).waitFor();
    mock.control({ restart: "mock-2" });
    // The page shows another instance and none of the first instance's data.
    await page.locator(".alert", { hasText: "MISSED 0+080" }).waitFor({ state: "detached" });
    await condition(page, "good");
  }));

  it("asks for a token if one is required", () => on({ token: "right" }, async ({ mock, page }) => {
    await word(page, "NO ACCESS");
    await page.getByLabel(/Token/).fill("wrong");
    await page.keyboard.press("Enter");
    await page.locator(".token p", { hasText: "token is wrong" }).waitFor();
    mock.control({ spent: true });
    await page.keyboard.press("Enter");
    await page.locator(".token p", { hasText: "Too many wrong tokens" }).waitFor();
    mock.control({ spent: false });
    await page.getByLabel(/Token/).fill("right");
    await page.keyboard.press("Enter");
    await condition(page, "good");
    assert.equal(await page.locator(".token").count(), 0);
  }));
});

describe("keyboard", () => {
  it("reaches every action", () => on({ mode: "demo", at_m: 60 }, async ({ mock, page }) => {
    await condition(page, "good");
    mock.control({ missed_m: 50 });
    await page.locator(".alert.open").first().waitFor();
    await page.keyboard.press("s");
    await page.locator(".said", { hasText: "done: silence" }).waitFor();
    assert.ok(mock.control({}).alerts.every((alert) => !alert.sounds));
    await page.keyboard.press("a");
    await page.locator(".alert.open").waitFor({ state: "detached" });
    mock.control({ missed_m: 40 });
    mock.control({ raise: { text: "another", kind: "other" } });
    await page.locator(".alert.open").nth(1).waitFor();
    await page.keyboard.press("Shift+A");
    await page.locator(".count", { hasText: "acknowledged" }).first().waitFor();
    await page.locator(".alert.open").first().waitFor({ state: "detached" });
    await page.keyboard.press("n");
    await page.keyboard.type("rubble left");
    await page.keyboard.press("Enter");
    await page.locator(".notes", { hasText: "rubble left" }).waitFor();
    assert.equal(mock.control({}).notes[0].text, "rubble left");
    await page.keyboard.press("b");
    await page.locator(".notes li", { hasText: "mark" }).waitFor();
    await page.keyboard.press("?");
    await page.locator("dialog.help[open]").waitFor();
    await page.keyboard.press("Escape");
    await page.locator("dialog.help[open]").waitFor({ state: "detached" });
    await page.keyboard.press("p");
    await page.locator(':root[data-palette="night"]').waitFor();
    for (const key of ["0", "+", "-", "ArrowLeft", "ArrowRight", "]", "ArrowDown", "ArrowUp", "[", "g", "f", "m", "v", "r"]) await page.keyboard.press(key);
    await condition(page, "good");
  }));

  it("controls a replay", () => on({ mode: "replay", at_m: 60 }, async ({ mock, page }) => {
    await page.locator(".replay").waitFor();
    await page.keyboard.press(" ");
    await page.locator(".paused").waitFor();
    // A paused dive doesn't age.
    for (const key of [".", ",", "l", "j"]) {
      const before = await page.locator(".replay input").inputValue();
      await page.keyboard.press(key);
      await page.waitForFunction((value) => document.querySelector(".replay input").value !== value, before);
    }
    await page.keyboard.press(">");
    await page.waitForFunction(() => document.querySelector(".replay select").value === "2");
    assert.equal(mock.control({}).playback.paused, true);
    await page.keyboard.press(" ");
    await page.locator(".paused").waitFor({ state: "detached" });
    assert.equal(mock.control({}).playback.paused, false);
    assert.ok(await page.getByRole("button", { name: "Ack all" }).isDisabled());
  }));
});

describe("accessibility", () => {
  for (const palette of ["day", "dusk", "night"]) {
    it(`axe finds no serious problem, ${palette}`, () => on({ at_m: 148 }, async ({ mock, page }) => {
      await condition(page, "good");
      mock.control({ speed_mps: 0.5 });
      mock.control({ missed_m: 140 });
      mock.control({ kill: "depth" });
      await page.locator(".alert.open").nth(1).waitFor();
      await page.locator('[data-sensor="depth"][data-state="silent"]').waitFor();
      await page.evaluate(AXE);
      const { violations } = await page.evaluate(() => window.axe.run(document, { resultTypes: ["violations"] }));
      const grave = violations.filter(({ impact }) => impact === "serious" || impact === "critical");
      assert.deepEqual(grave.map(({ id, nodes }) => `${id}: ${nodes.map((node) => `${node.target} ${node.any[0]?.message ?? ""}`).join("; ")}`), []);
    }, { palette, reducedMotion: "reduce" }));
  }

  it("axe finds no serious problem in a finished dive", () => on({ at_m: 148 }, async ({ mock, page }) => {
    mock.control({ world: { legs: [{ from_m: 16.25, to_m: 10.75, at_most_mps: 0.0925, why: "too_fast" }] }, end: {} });
    await word(page, "DIVE ENDED");
    await page.evaluate(AXE);
    for (const palette of ["day", "dusk", "night"]) {
      const { violations } = await page.evaluate((palette) => {
        document.documentElement.dataset.palette = palette;
        return window.axe.run(document, { resultTypes: ["violations"] });
      }, palette);
      const grave = violations.filter(({ impact }) => impact === "serious" || impact === "critical");
      assert.deepEqual(grave.map(({ id, nodes }) => `${palette} ${id}: ${nodes.map((node) => `${node.target} ${node.any[0]?.message ?? ""}`).join("; ")}`), []);
    }
  }, { reducedMotion: "reduce", init: withoutWebGl }));

  it("green, amber and red differ under deuteranopia, and also by shape and word", () => on({}, async ({ page }) => {
    await condition(page, "good");
    const colours = await page.evaluate(() => ["day", "dusk", "night"].flatMap((palette) => {
      document.documentElement.dataset.palette = palette;
      const style = getComputedStyle(document.documentElement);
      return [["green", "amber", "red"].map((name) => style.getPropertyValue(`--${name}`).trim())];
    }));
    for (const three of colours) {
      const labs = three.map((hex) => lab(deuteranopia(hex)));
      for (const [a, b] of [[0, 1], [1, 2], [0, 2]]) {
        const apart = Math.hypot(...labs[a].map((part, at) => part - labs[b][at]));
        assert.ok(apart > 15, `${three[a]} and ${three[b]} are ${apart.toFixed(1)} apart`);
      }
    }
  }));
});

/** Machado, Oliveira, Fernandes 2009, severity 1, on linear RGB. */
function deuteranopia(hex) {
  const six = hex.length === 4 ? [...hex.slice(1)].map((d) => d + d).join("") : hex.slice(1);
  const linear = [0, 2, 4].map((at) => parseInt(six.slice(at, at + 2), 16) / 255).map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
  return [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]].map((row) => Math.max(0, row[0] * linear[0] + row[1] * linear[1] + row[2] * linear[2]));
}
function lab([r, g, b]) {
  const xyz = [(0.4124 * r + 0.3576 * g + 0.1805 * b) / 0.95047, 0.2126 * r + 0.7152 * g + 0.0722 * b, (0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.08883];
  const [x, y, z] = xyz.map((v) => (v > 0.008856 ? Math.cbrt(v) : 7.787 * v + 16 / 116));
  return [116 * y - 16, 500 * (x - y), 200 * (y - z)];
}

describe("exported dive", () => {
  it("opens without a network, with a time slider", async () => {
    const world = new World({ length_m: 7000, at_m: 60 });
    const states = [], t_s = [];
    for (let n = 0; n < 20; n += 1) { world.step(1); t_s.push(world.t_s); states.push(world.state()); }
    const parts = [];
    const add = (kind, bytes) => { const head = Buffer.alloc(5); head.writeUInt32LE(bytes.length); head[4] = kind; parts.push(head, bytes); };
    const text = (message) => add(0, Buffer.from(JSON.stringify(message)));
    text({ ...world.hello(), mode: "file", thinned: 1200 });
    add(1, sectionsFrame(0, 240, world.at_m, 0));
    add(1, samplesFrame(samplesBetween(0, 60)));
    text({ type: "alerts", list: [{ ...world.missed(40), acknowledged: { by: "AB", at_s: 1 } }] });
    text({ type: "notes", list: [{ number: 1, at_s: 300, by: "AB", text: "rubble", chainage_m: 20, station: "0+020" }] });
    text(world.history());
    text({ type: "timeline", t_s, states: states.map(({ sensors, ...state }, n) => (n === 0 ? { sensors, ...state } : state)) });
    text({ ...world.state(), metres: { ...world.state().metres, pass_m: 1 }, outstanding: "5.50 m missed, from 0+010.75" });
    text({ type: "end", digest: "0", exit: 0, summary: { pass_m: 57.5, fail_m: 5.5, cannot_say_m: 0, not_inspected_m: 1, open_m: 0 }, way: { length_m: 64 } });
    const single = readFileSync(new URL("../dist/single.html", import.meta.url), "utf8");
    assert.equal(single.split("<!--DIVE-->").length, 2);
    const page1 = single.replace("<!--DIVE-->", () => `<script type="application/octet-stream;base64" id="dive">${deflateRawSync(Buffer.concat(parts)).toString("base64")}</script>`);
    const requests = [];
    const server = createServer((request, response) => { requests.push(request.url); response.setHeader("content-type", "text/html"); response.end(page1); });
    await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
    const { page, context, problems } = await open(chromium, `http://127.0.0.1:${server.address().port}/`);
    try {
      // The file opens at the end of the dive.
      await word(page, "DIVE ENDED");
      assert.deepEqual(await page.locator(".result dd").allInnerTexts(), ["57.5 m", "5.50 m", "0.00 m", "1.00 m"]);
      assert.equal(await page.locator(".result .outstanding").innerText(), "5.50 m missed, from 0+010.75");
      assert.match(await page.locator(".chainage").innerText(), /0\+063\.6/);
      assert.match(await page.locator(".age").innerText(), /from a file/);
      assert.match(await page.locator(".dive").innerText(), /1,200 samples left out/);
      await page.locator(".notes", { hasText: "rubble" }).waitFor();
      await page.getByLabel("Time of the dive").focus();
      await page.keyboard.press("Home");
      await page.locator(".chainage", { hasText: "0+060.2" }).waitFor();
      await word(page, "GOOD");
      assert.equal(await page.locator(".result").count(), 0);
      // The list of the end says nothing about earlier times.
      assert.match(await page.locator(".back").innerText(), /only for the end of the dive/);
      // Constant parts are in the first entry only.
      assert.equal(await page.locator(".sensor[data-sensor]").count(), 10);
      assert.deepEqual(requests.filter((url) => url !== "/"), []);
      assert.deepEqual(problems, []);
    } finally {
      await context.close();
      server.closeAllConnections();
      server.close();
    }
  });
});

describe("drawing speed", () => {
  it("is measured and printed at 7 km with 28,000 sections", () => on({ at_m: 6990 }, async ({ page }) => {
    await condition(page, "good");
    const measure = (span) => page.evaluate(async ({ span, count }) => {
      const press = (key) => dispatchEvent(new KeyboardEvent("keydown", { key }));
      press(span === "whole" ? "0" : "f");
      await new Promise((resolve) => setTimeout(resolve, 1000));
      const times = [];
      let last = performance.now();
      for (let n = 0; n < count; n += 1) {
        press(n % 2 ? "ArrowLeft" : "ArrowRight");
        await new Promise(requestAnimationFrame);
        times.push(performance.now() - last);
        last = performance.now();
      }
      times.sort((a, b) => a - b);
      return { median: times[count >> 1], p95: times[Math.floor(count * 0.95)] };
    }, { span, count: 120 });
    for (const span of ["whole", "60 m with discs"]) {
      const { median, p95 } = await measure(span === "whole" ? span : "near");
      console.log(`# frame time in software, ${span}: median ${median.toFixed(1)} ms, p95 ${p95.toFixed(1)} ms`);
    }
  }));
});
