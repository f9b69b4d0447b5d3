// Types of the feed's messages, with the server's names. Lengths are in metres, times in seconds on the log's clock.
import type { CLASSES, CONDITIONS, POSITION_WHY, PRIORITIES, REASONS, SENSOR_STATES } from "../text/table";

export type Mode = "live" | "demo" | "replay" | "file";
export type Lamp = "green" | "amber" | "red";
/** Speed texts, rounded as on all screens. `limit` and `margin` are null if no limit applies at present. */
export interface Speeds { speed: string | null; limit: string | null; margin: string | null }
export type Condition = keyof typeof CONDITIONS;
export type Priority = keyof typeof PRIORITIES;
export type AlertClass = (typeof CLASSES)[number];

export interface Head { id: string; source: number; hidden_deg: [number, number][] }

export interface Hello {
  type: "hello"; seq: number; version: number; program: string; instance: string; mode: Mode;
  dive: string; vehicle: string; target_m: number; compared_m?: number; section_m: number; confidence_sd: number;
  length_m: number | null; perimeter_m: number; profile: [number, number][]; clock_arc_m: number[];
  heads: Head[]; sensors: { id: string; plugin: string; kind: string }[];
  may: { operate: boolean; playback: boolean };
  begun_utc_s: number | null; causes: string[]; whys: string[];
  span_s: [number, number] | null; tokens_needed: boolean; thinned?: number | null;
}

export interface Sensor {
  id: string; state: keyof typeof SENSOR_STATES; age_s: number | null; is_head: boolean;
  withheld: string | null;
}

export interface Turn {
  target_m: number; predicted_t_m: number | null; will_exceed: boolean; t_y_m: number; pass_gap_s: number;
  phase_error_deg: number | null;
}

export interface State {
  type: "state"; seq?: number; t_s: number; text: string; now_s: number; at_s: number | null; age_s: number | null; old: boolean;
  condition: Condition; lamp: Lamp; recording_fails?: boolean;
  position: {
    state: "ok" | "doubtful" | "none"; why: keyof typeof POSITION_WHY | null; chainage_m: number | null; station: string | null;
    chainage_sd_m: number | null; place_sd_m: number | null; yaw_sd_deg: number | null; pass_sd_m: number | null; stand_s: number;
  };
  speed_mps: number | null; v_max_mps: number | null; reason: keyof typeof REASONS | null; remedy?: string | null;
  margins: { speed_mps: number | null; turn_m: number | null; position_m: number | null; lost_share: number | null };
  /** Files of earlier versions lack this field and the next two. */
  speeds?: Speeds;
  /** Missed sections that are still to be passed, as text. */
  outstanding?: string | null;
  /** Plan for the rest of the dive. */
  plan?: Plan | null;
  /** Depth below the water level. */
  depth_m?: number | null;
  turn: Turn | null;
  sensors: Sensor[];
  metres: Metres;
  /** Verdicts of the same dive for the second target, which the hello states. */
  compared?: { target_m: number; pass_m: number; fail_m: number; cannot_say_m: number; open_m: number; not_inspected_m: number };
  cannot_say: { why: string; from_m: number; to_m: number } | null;
  /** Whether the replay has reached its end, or the dive has ended. */
  ended?: boolean;
  alert_list?: Alert[]; alerts_hidden?: number;
  left?: { cable_m: number | null; time_s: number | null; battery_pct: number | null } | null;
  /** UTC at which the dive began. The hello of a page that was opened before states null. */
  begun_utc_s?: number | null;
  pose?: { y_m: number; z_m: number; roll_deg: number; pitch_deg: number; yaw_deg: number } | null;
  echosounders?: Echosounder[];
  rates?: { id: string; hz: number }[];
  recording?: { on: boolean; fails: boolean; words: string | null; path: string | null; read_again_pct?: number | null } | null;
  playback?: Playback | null;
}

/** Lengths by verdict, and of the whole coverage extent. */
export interface Metres { pass_m: number; fail_m: number; cannot_say_m: number; open_m: number; not_inspected_m: number; way_m: number }

export interface Echosounder {
  id: string; range_m: number | null; age_s: number | null; from: [number, number]; to: [number, number] | null;
}
export interface Playback { paused: boolean; speed: number | null; at_s: number; from_s: number; to_s: number }

export interface Alert {
  number: number; priority: Priority; class: AlertClass; kind: string; text: string; advice: string | null;
  state: "active" | "rectified" | "cleared"; since_s: number; rectified_s: number | null; cleared_s: number | null;
  acknowledged: { by: string; at_s: number } | null; silenced_until_s: number | null; sounds: boolean;
  needs_acknowledgement: boolean; from_m: number | null; to_m: number | null; back_to_m: number | null;
  at_most_mps: number | null; sensor: string | null; count: number;
}

export interface Note {
  number: number; at_s: number; by: string; text: string; chainage_m: number | null; station: string | null;
  /** Set for a voice note. `seconds` is null if the log has no recording of it. */
  voice?: { id: number; seconds: number | null } | null;
}
/** The next three steps, and whether the plan fits into the remaining time. */
export interface Plan { steps: Step[]; fits: string; all_fits: boolean }
export interface Step { text: string; from_m: number; to_m: number }

/** A stretch is passed again as far as `back_to_m`, so that all heads pass it. */
export interface Leg { from_m: number; to_m: number; back_to_m?: number; at_most_mps: number | null; why: string }
/** `time_s` is null if a leg has no speed. */
export interface Back { legs: Leg[]; way_m: number; time_s: number | null }
export interface History { t_s: number[]; v_mps: (number | null)[]; v_max_mps: (number | null)[]; t_m: (number | null)[] }

/** Result of the dive. The last state may lack verdicts that became final at the end. */
export interface End { summary?: Omit<Metres, "way_m">; way?: { length_m: number } | null; digest?: string; exit?: number }

/** An event, as in a line of `--json-lines`. */
export interface Told { type: string; t_s: number; text: string }

export type Message =
  | Hello | State | Told
  | { type: "alerts"; list: Alert[]; hidden?: number }
  | { type: "alert_change"; change: string; alert: Alert }
  | { type: "notes"; list: Note[] }
  | (Note & { type: "note" })
  | ({ type: "history" } & History)
  | ({ type: "back" } & Back)
  | { type: "ready" }
  | { type: "refused"; why: string }
  | { type: "done"; do: string }
  | { type: "voice"; id: number; media_type: string; audio: string }
  | { type: "timeline"; t_s: number[]; states: Partial<State>[] }
  | ({ type: "end" } & End);

/** Messages that the page sends. */
export type Command =
  | { do: "acknowledge"; alert: number; by: string }
  | { do: "silence"; by: string }
  | { do: "note"; text: string; by: string }
  | { do: "mark"; by: string }
  | { do: "voice"; id: number; by: string }
  | { do: "play"; command: "pause" | "go" | "step" | "step_section" | "end" }
  | { do: "play"; command: "speed"; speed: number | null }
  | { do: "play"; command: "seek"; to_s: number }
  | { do: "rate"; hz: number };
