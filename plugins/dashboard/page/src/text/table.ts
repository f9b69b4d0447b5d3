// Words for the codes of the feed. Generated from core/monitor/src/words.rs; renew it with
// HEADRACE_RENEW_WORDS=1 cargo test -p headrace_tests --test page words

/** Conditions: name, explanation, action, and words before v_max. */
export const CONDITIONS = {
  no_data: { name: "WAITING", detail: "no reading from any sensor yet", action: "", speed: "" },
  old: { name: "OLD", detail: "nothing from any sensor", action: "stop", speed: "" },
  no_position: { name: "NO POSITION", detail: "", action: "hold still", speed: "" },
  outside: { name: "OUTSIDE", detail: "no head is within the tunnel", action: "", speed: "" },
  no_sonar: { name: "NO SONAR", detail: "no returns", action: "stop", speed: "" },
  passed: { name: "passed here", detail: "any speed will do", action: "", speed: "" },
  going_back: { name: "going back", detail: "at any speed", action: "", speed: "" },
  no_speed: { name: "slower won't help", detail: "no speed meets the target here", action: "", speed: "" },
  too_fast: { name: "TOO FAST", detail: "", action: "", speed: "at most" },
  turn_fails: { name: "THIS TURN MISSES", detail: "", action: "", speed: "go" },
  cannot_say: { name: "CAN'T SAY", detail: "", action: "", speed: "at most" },
  over: { name: "a little fast", detail: "", action: "", speed: "at most" },
  turn_unsure: { name: "THIS TURN MAY MISS", detail: "", action: "", speed: "go" },
  good: { name: "good", detail: "", action: "", speed: "may go up to" },
} as const;

/** Condition if sensors deliver data, but no update has come yet. */
export const STARTING = "STARTING";

/** Action for finding the gyros' bias. */
export const STAND_STILL = "stand still";

/** Reasons for a missing or doubtful position. */
export const POSITION_WHY = {
  no_heading: "heading unknown",
  no_chainage: "chainage unknown",
  no_place_in_section: "lateral position unknown",
  cable: "cable doubtful",
  spread: "position drifts between passes",
} as const;

/** Factors that limit the speed. */
export const REASONS = {
  helix_pitch: "distance between turns",
  angular_step: "samples too far apart along the wall: slower won't help",
  no_heading_or_fix: "no position or heading",
  no_returns: "no sonar returns",
} as const;

/** States of a section. */
export const VERDICTS = {
  open: "open",
  pass: "passed",
  fail: "missed",
  cannot_say: "can't say",
  not_inspected: "not inspected",
} as const;

/** State of wall without any data. */
export const UNSEEN = "unseen";

/** States of a sensor. */
export const SENSOR_STATES = {
  never: "no data yet",
  silent: "silent",
  withheld: "readings withheld",
  stalled: "doesn't turn",
  deaf: "detects no wall",
  hung: "stuck",
  distrusted: "not trusted",
  ok: "ok",
} as const;

/** Priorities of alerts. */
export const PRIORITIES = {
  emergency_alarm: "EMERGENCY",
  alarm: "ALARM",
  warning: "WARNING",
  caution: "CAUTION",
} as const;

/** Classes of alerts. */
export const CLASSES = ["coverage", "speed", "position", "sensor", "recording", "setting"] as const;

/** Notes without a text. */
export const NOTES = {
  mark: "mark",
  voice: "voice",
} as const;
