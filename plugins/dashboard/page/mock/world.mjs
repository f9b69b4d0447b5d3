// State of the mock dive over time: speed, alerts with their life cycle, failing sensors, lost position.
import * as dive from "./dive.mjs";

const SENSORS = [
  { id: "bow_port", plugin: "imagenex881", kind: "profiling sonar" }, { id: "bow_star", plugin: "imagenex881", kind: "profiling sonar" },
  { id: "aft_port", plugin: "imagenex881", kind: "profiling sonar" }, { id: "aft_star", plugin: "imagenex881", kind: "profiling sonar" },
  { id: "tether", plugin: "tether_hid", kind: "counter" }, { id: "ahrs", plugin: "mavlink", kind: "attitude" },
  { id: "echo_up", plugin: "ping1d", kind: "echosounder" }, { id: "echo_left", plugin: "ping1d", kind: "echosounder" },
  { id: "echo_right", plugin: "ping1d", kind: "echosounder" }, { id: "depth", plugin: "bar100", kind: "depth" },
];
/** UTC at which the dive begins: 2026-08-30 06:00:00. */
const BEGUN_UTC_S = Date.UTC(2026, 7, 30, 6) / 1000;
const station = (m) => `${Math.floor(m / 1000)}+${(m % 1000).toFixed(2).padStart(6, "0")}`;
/** Speeds as the program writes them. */
const speedText = (v) => v.toFixed(Math.abs(v) < 0.1 ? 3 : 2);
const round = (x, n = 4) => Math.round(x * 10 ** n) / 10 ** n;

export class World {
  constructor({ length_m = 7000, at_m = 6990, mode = "demo", instance = "mock-1" } = {}) {
    Object.assign(this, { length_m, at_m, mode, instance });
    this.t_s = at_m / 0.2;
    this.speed_mps = 0.18;
    this.v_max_mps = 0.24;
    this.condition = "good";
    this.lamp = "green";
    this.position = "ok";
    this.dead = new Map();
    this.frozen_s = null;
    this.alerts = [];
    this.notes = [];
    this.voices = new Map();
    this.playback = mode === "replay" ? { paused: false, speed: 1 } : null;
    this.numbers = 0;
    this.remedy = null;
    this.recording = { on: true, fails: false, words: null, path: "dive.mcap" };
    this.changes = [];
    /** Fields of the state that a test sets, and the legs of the way back. */
    this.over = {};
    this.legs = null;
    this.seedAlerts();
  }

  hello() {
    return { type: "hello", version: 2, program: "headrace mock", instance: this.instance, mode: this.mode, dive: "made-up dive",
      vehicle: "mock", target_m: dive.TARGET_M, section_m: dive.SECTION_M, confidence_sd: 2, length_m: this.length_m,
      perimeter_m: dive.PERIMETER_M, profile: dive.PROFILE, clock_arc_m: dive.CLOCK_ARC_M,
      heads: SENSORS.slice(0, 4).map(({ id }, source) => ({ id, source, hidden_deg: source < 2 ? [[100, 125]] : [[235, 260]] })),
      sensors: SENSORS, may: { operate: this.mode !== "replay", playback: this.mode !== "live" }, begun_utc_s: BEGUN_UTC_S,
      causes: dive.CAUSES, whys: dive.WHYS, span_s: this.mode === "replay" ? [0, this.length_m / 0.2] : null,
      tokens_needed: false };
  }

  /** A missed run raises one alert; alerts of the trajectory so far: the last few runs. */
  seedAlerts() {
    for (let k = Math.max(0, Math.floor(this.at_m / 137) - 4); k * 137 + 18.25 < this.at_m - 1; k += 1) {
      const alert = this.missed(k * 137 + 12);
      alert.since_s = alert.to_m / 0.2;
      alert.acknowledged = { by: "AB", at_s: alert.since_s + 6 };
    }
  }

  missed(from_m) {
    return this.raise({ priority: "alarm", class: "coverage", kind: "missed", from_m, to_m: from_m + 6.25, back_to_m: from_m - 2,
      at_most_mps: 0.08, text: `MISSED ${station(from_m).slice(0, -3)} to ${station(from_m + 6.25).slice(0, -3)}, crown left: too fast`,
      advice: `inspect again from ${station(from_m - 2).slice(0, -3)}, at most 0.08 m/s` });
  }

  raise(over) {
    this.numbers += 1;
    const caution = over.priority === "caution";
    const alert = { number: this.numbers, priority: "warning", class: "sensor", kind: "sensor_silent", text: "", advice: null,
      state: "active", since_s: round(this.t_s), rectified_s: null, cleared_s: null, acknowledged: null, silenced_until_s: null,
      sounds: !caution, needs_acknowledgement: !caution, from_m: null, to_m: null, back_to_m: null, at_most_mps: null, sensor: null,
      count: 1, ...over };
    this.alerts.push(alert);
    this.change("raised", alert);
    return alert;
  }

  change(change, alert) {
    this.changes.push({ type: "alert_change", t_s: round(this.t_s), text: alert.text, change, alert: { ...alert } });
  }

  settle(match) {
    for (const alert of this.alerts.filter((each) => each.state === "active" && match(each))) {
      const open = alert.needs_acknowledgement && !alert.acknowledged;
      alert.state = open ? "rectified" : "cleared";
      alert[open ? "rectified_s" : "cleared_s"] = round(this.t_s);
      alert.sounds = false;
      this.change(open ? "rectified" : "cleared", alert);
    }
    this.alerts = this.alerts.filter((alert) => alert.state !== "cleared");
  }

  acknowledge(number, by) {
    for (const alert of this.alerts) {
      if (!alert.needs_acknowledgement || alert.acknowledged || (number !== 0 && alert.number !== number)) continue;
      alert.acknowledged = { by, at_s: round(this.t_s) };
      alert.sounds = false;
      if (alert.state === "rectified") { alert.state = "cleared"; alert.cleared_s = round(this.t_s); }
      this.change(alert.state === "cleared" ? "cleared" : "acknowledged", alert);
    }
    this.alerts = this.alerts.filter((alert) => alert.state !== "cleared");
  }

  silence() {
    for (const alert of this.alerts.filter((each) => each.sounds)) {
      alert.silenced_until_s = round(this.t_s + 30);
      alert.sounds = false;
      this.change("silenced", alert);
    }
  }

  spoken(id, seconds, sound) {
    const at = this.notes.findIndex((note) => note.voice?.id === id);
    this.notes[at] = { ...this.notes[at], voice: { id, seconds } };
    this.voices.set(id, sound);
    this.changes.push({ type: "note", t_s: round(this.t_s), ...this.notes[at] });
  }

  note(text, by, voice = null) {
    this.notes.push({ number: this.notes.length + 1, at_s: round(this.t_s), by, text, voice, chainage_m: round(this.at_m, 2), station: station(this.at_m) });
    this.changes.push({ type: "note", t_s: round(this.t_s), ...this.notes.at(-1) });
  }

  kill(id) {
    this.dead.set(id, this.t_s);
  }

  setSpeed(speed_mps) {
    const wasFast = this.condition === "too_fast";
    this.speed_mps = speed_mps;
    const fast = speed_mps > this.v_max_mps * 1.05;
    this.condition = fast ? "too_fast" : "good";
    this.lamp = fast ? "red" : "green";
    if (fast && !wasFast) {
      this.raise({ priority: "warning", class: "speed", kind: "too_fast", text: `TOO FAST ${speed_mps.toFixed(2)} m/s at ${station(this.at_m).slice(0, -3)}`,
        advice: `at most ${this.v_max_mps.toFixed(2)} m/s`, at_most_mps: this.v_max_mps });
    }
    if (!fast && wasFast) this.settle((alert) => alert.kind === "too_fast");
  }

  /** Advances by some seconds; returns the pings. */
  step(by_s) {
    if (this.playback?.paused) return [];
    const from_s = this.t_s, from_m = this.at_m, speed = this.speed_mps * (this.playback?.speed ?? 1);
    this.t_s += by_s;
    this.at_m = Math.min(this.length_m, this.at_m + speed * by_s);
    // A stretch passed too fast counts as missed once the vehicle has left it.
    const run_m = Math.floor(this.at_m / 137) * 137 + 12;
    if (this.at_m > run_m + 7.25 && from_m <= run_m + 7.25) this.missed(run_m);
    for (const [id, since] of this.dead) {
      if (this.t_s - since > 2 && !this.alerts.some((alert) => alert.sensor === id)) {
        this.raise({ priority: "warning", kind: "sensor_silent", sensor: id, text: `${id} silent`, advice: "check its cable and supply" });
      }
    }
    const heads = [0, 1, 2, 3].filter((head) => !this.dead.has(SENSORS[head].id));
    return dive.pings(from_s, this.t_s, (t) => from_m + (t - from_s) * speed, heads);
  }

  state() {
    const none = this.position === "none", x = this.at_m, v = this.speed_mps + 0.01 * Math.sin(this.t_s);
    const condition = none ? "no_position" : this.condition, lamp = none ? "red" : this.lamp;
    const age = (id) => round(this.dead.has(id) ? this.t_s - this.dead.get(id) : 0.04);
    const predicted = round(0.5 * (this.speed_mps / this.v_max_mps) ** 0.8);
    const missed = Math.floor(x / 137) * 6.25, unsure = Math.floor(x / 411) * 14;
    const yaw = 2 * Math.sin(this.t_s / 7);
    return { type: "state", version: 3, t_s: round(this.t_s), text: "", now_s: round(this.t_s), at_s: round(this.t_s), age_s: 0.02, old: false,
      condition, lamp,
      position: { state: none ? "none" : this.position, why: none ? "no_heading" : this.position === "doubtful" ? "cable" : null,
        chainage_m: none ? null : round(x), station: none ? null : station(x), chainage_sd_m: none ? null : 0.31, place_sd_m: none ? null : 0.04,
        yaw_sd_deg: none ? null : 0.6, pass_sd_m: none ? null : 0.012 },
      speed_mps: none ? null : round(v), v_max_mps: none ? null : this.v_max_mps, reason: none ? "no_heading_or_fix" : "helix_pitch",
      remedy: this.remedy, margins: { speed_mps: none || this.v_max_mps === null ? null : round(this.v_max_mps - v), turn_m: none ? null : round(dive.TARGET_M - predicted), position_m: none ? null : 0.024, lost_share: null },
      turn: none ? null : { target_m: dive.TARGET_M, predicted_t_m: predicted, will_exceed: predicted > dive.TARGET_M, t_y_m: 0.29, pass_gap_s: 1, phase_error_deg: 2 },
      sensors: SENSORS.map(({ id }, n) => ({ id, state: this.dead.has(id) && age(id) > 2 ? "silent" : "ok", age_s: age(id), is_head: n < 4, withheld: null })),
      metres: { pass_m: round(x - missed - unsure - 1.8, 2), fail_m: missed, cannot_say_m: unsure, open_m: 0.8, not_inspected_m: 1, way_m: round(x, 2) },
      cannot_say: null,
      alert_counts: { unacknowledged: this.alerts.filter((a) => a.needs_acknowledgement && !a.acknowledged).length, active: this.alerts.length },
      alert_list: this.alerts.slice(-64), alerts_hidden: Math.max(0, this.alerts.length - 64),
      left: { cable_m: round(7400 - x, 1), time_s: Math.max(0, 40_000 - this.t_s), battery_pct: 63 },
      pose: none ? null : { y_m: 0.3 * Math.sin(this.t_s / 5), z_m: 3 + 0.2 * Math.cos(this.t_s / 6), roll_deg: 3 * Math.sin(this.t_s / 3), pitch_deg: 1.2, yaw_deg: yaw },
      echosounders: ["up", "left", "right"].map((side, n) => ({ id: `echo_${side}`, range_m: [3, 2.8, 3.2][n], age_s: age(`echo_${side}`),
        from: [0.3 * Math.sin(this.t_s / 5), 3], to: [[0.1, 5.99], [2.99, 2.9], [-2.99, 3.1]][n] })),
      rates: SENSORS.map(({ id }, n) => ({ id, hz: this.dead.has(id) ? 0 : n < 4 ? 18 : [10, 50, 20, 20, 20, 5][n - 4] })),
      recording: this.recording,
      playback: this.playback ? { ...this.playback, at_s: round(this.t_s), from_s: 0, to_s: this.length_m / 0.2 } : null,
      ...this.texts(v, missed), ...this.over };
  }

  /** Texts and figures that earlier versions of the program lack. */
  texts(v, missed) {
    const most = this.position === "none" ? null : this.v_max_mps, spare = most === null ? 0 : Number(speedText(most)) - Number(speedText(Math.abs(v)));
    const margin = Math.abs(spare) < 0.001 ? "at the limit" : `${speedText(Math.abs(spare))} ${spare > 0 ? "to spare" : "too fast"}`;
    return { speeds: { speed: this.position === "none" ? null : speedText(Math.abs(v)), limit: most === null ? null : speedText(most), margin: most === null ? null : margin },
      outstanding: missed > 0 ? `${missed.toFixed(2)} m missed, from 0+012.00` : null, depth_m: round(12.3 + 0.001 * this.at_m, 2) };
  }

  back() {
    if (this.legs) return { type: "back", legs: this.legs, way_m: 12.5, time_s: this.legs.some((leg) => leg.at_most_mps === null) ? null : 140 };
    const legs = this.alerts.filter((alert) => alert.kind === "missed" && alert.state === "active").reverse()
      .map(({ from_m, to_m }) => ({ from_m: from_m - 2, to_m, at_most_mps: 0.08, why: "too fast" }));
    const way_m = legs.length === 0 ? 0 : this.at_m - Math.min(...legs.map((leg) => leg.from_m));
    return { type: "back", legs, way_m: round(way_m, 1), time_s: round(way_m / 0.2 + legs.length * 100, 0) };
  }

  history() {
    const t_s = Array.from({ length: 900 }, (_, n) => round(this.t_s - 900 + n));
    return { type: "history", t_s, v_mps: t_s.map((t) => round(0.18 + 0.03 * Math.sin(t / 20))), v_max_mps: t_s.map((t) => (t % 300 < 40 ? 0.16 : 0.24)), t_m: t_s.map(() => 0.41) };
  }
}
