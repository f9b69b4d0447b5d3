// All data of the page: the feed's content, with a topic for each subject. The page computes nothing except the order
// of items.
import { KIND_SECTIONS, type Frame } from "../feed/binary";
import type { Alert, Back, End, Hello, History, Message, Note, State, Told } from "../feed/types";
import { Sections } from "./sections";
import { Topic } from "./topic";
import { Turns } from "./turns";

const HISTORY_S = 1800;
const MOST_TOLD = 60;
const MOST_CLEARED = 64;

export interface Link {
  phase: "connecting" | "open" | "lost" | "refused" | "file";
  /** Start of the phase, performance.now(). */
  since_ms: number;
  /** Time of the last message. */
  heard_ms: number;
  tries: number;
  why: string;
}

export type AlertListener = (alert: Alert, change: string) => void;
export type SampleListener = (frame: Frame) => void;

export class Store {
  hello: Hello | null = null;
  state: State | null = null;
  /** Time at which the state arrived, performance.now(). The state's age counts from then on. */
  state_ms = 0;
  seq = 0;
  /** Whether all data has arrived since the last hello. */
  ready = false;
  /** Number of connections so far. */
  session = 0;
  /** Whether all data has arrived once, so that a later connection needs only the changes. */
  private known = false;
  end: End | null = null;
  alerts = new Map<number, Alert>();
  alertsHidden = 0;
  notes: Note[] = [];
  told: Told[] = [];
  back: Back = { legs: [], way_m: 0, time_s: 0 };
  history: History = emptyHistory();
  readonly sections = new Sections();
  readonly turns = new Turns();
  readonly link: Link = { phase: "connecting", since_ms: 0, heard_ms: 0, tries: 0, why: "" };
  /** Answer to the last command, for the status line. */
  answer: { text: string; refused: boolean; at_ms: number } | null = null;

  readonly topics = {
    hello: new Topic(), state: new Topic(), alerts: new Topic(), notes: new Topic(), told: new Topic(), back: new Topic(),
    history: new Topic(), sections: new Topic(), samples: new Topic(), link: new Topic(), clock: new Topic(), answer: new Topic(),
  };
  private readonly alertListeners = new Set<AlertListener>();
  private readonly sampleListeners = new Set<SampleListener>();

  onAlert(listener: AlertListener): () => void {
    this.alertListeners.add(listener);
    return () => this.alertListeners.delete(listener);
  }
  onSamples(listener: SampleListener): () => void {
    this.sampleListeners.add(listener);
    return () => this.sampleListeners.delete(listener);
  }

  take(message: Message & { seq?: number }): void {
    if (typeof message.seq === "number") this.seq = message.seq;
    switch (message.type) {
      case "hello": return this.takeHello(message as Hello);
      case "state": return this.takeState(message as State);
      case "alerts": return this.takeAlerts(message as { list: Alert[]; hidden?: number });
      case "alert_change": return this.takeAlertChange(message as { change: string; alert: Alert });
      case "notes":
        this.notes = [...(message as { list: Note[] }).list];
        return this.topics.notes.changed();
      case "note": return this.takeNote(message as Note);
      case "history": {
        const { t_s, v_mps, v_max_mps, t_m } = message as History & { type: "history" };
        this.history = { t_s: [...t_s], v_mps: [...v_mps], v_max_mps: [...v_max_mps], t_m: [...t_m] };
        return this.topics.history.changed();
      }
      case "back":
        this.back = message as Back & { type: "back" };
        return this.topics.back.changed();
      case "ready":
        this.ready = this.known = true;
        return this.topics.hello.changed();
      case "refused":
        return this.answered((message as { why: string }).why, true);
      case "done":
        return this.answered(`done: ${(message as { do: string }).do}`, false);
      case "end":
        this.end = message as End;
        return this.topics.state.changed();
      default:
        if (typeof (message as Told).text === "string") this.tell(message as Told);
    }
  }

  takeFrame(frame: Frame): void {
    if (frame.seq > 0) this.seq = frame.seq;
    if (frame.kind === KIND_SECTIONS) {
      this.sections.take(frame);
      this.topics.sections.changed();
    } else {
      this.turns.take(frame);
      this.sampleListeners.forEach((listener) => listener(frame));
      this.topics.samples.changed();
    }
  }

  answered(text: string, refused: boolean): void {
    this.answer = { text, refused, at_ms: performance.now() };
    this.topics.answer.changed();
  }

  /** Instance whose feed a new connection resumes; empty if there is nothing to resume. */
  get instance(): string {
    return this.known ? (this.hello?.instance ?? "") : "";
  }

  private takeHello(hello: Hello): void {
    if (this.hello?.instance !== hello.instance) this.forget();
    this.hello = hello;
    this.ready = false;
    this.session += 1;
    this.topics.hello.changed();
  }

  private forget(): void {
    this.state = null;
    this.ready = this.known = false;
    this.end = null;
    this.alerts.clear();
    this.notes = [];
    this.told = [];
    this.back = { legs: [], way_m: 0, time_s: 0 };
    this.history = emptyHistory();
    this.sections.clear();
    this.turns.clear();
    for (const topic of Object.values(this.topics)) topic.changed();
  }

  private takeState(state: State): void {
    const before = this.state;
    this.state = state;
    this.state_ms = performance.now();
    // A page that was open before the dive's first data learns only now when the dive began.
    if (this.hello && state.begun_utc_s) this.hello.begun_utc_s = state.begun_utc_s;
    if (state.alerts_hidden !== undefined && state.alerts_hidden !== this.alertsHidden) {
      this.alertsHidden = state.alerts_hidden;
      this.topics.alerts.changed();
    }
    // Samples that arrived before a jump back in time are later than the new time, and so no longer valid.
    if (before && state.now_s < before.now_s - 1) {
      if (this.link.phase !== "file") this.turns.clear();
      this.end = null;
      if (state.alert_list) this.takeAlerts({ list: state.alert_list });
    } else if (this.link.phase === "file" && state.alert_list) this.takeAlerts({ list: state.alert_list });
    else this.renewAlerts(state.alert_list ?? []);
    this.topics.state.changed();
    this.grow(state);
  }

  /** Extends the history from the states, once a second. */
  private grow(state: State): void {
    if (state.at_s === null || this.link.phase === "file") return;
    const { t_s, v_mps, v_max_mps, t_m } = this.history;
    const columns = [t_s, v_mps, v_max_mps, t_m];
    while (t_s.length > 0 && (t_s.at(-1) ?? 0) > state.at_s) columns.forEach((column) => column.pop());
    if (t_s.length > 0 && state.at_s - (t_s.at(-1) ?? 0) < 1) return;
    t_s.push(state.at_s);
    v_mps.push(state.speed_mps);
    v_max_mps.push(state.v_max_mps);
    t_m.push(state.turn?.predicted_t_m ?? null);
    while ((t_s[0] ?? 0) < state.at_s - HISTORY_S) columns.forEach((column) => column.shift());
    this.topics.history.changed();
  }

  private takeAlerts({ list, hidden }: { list: Alert[]; hidden?: number }): void {
    const before = this.alerts;
    this.alerts = new Map(list.map((alert) => [alert.number, alert]));
    if (hidden !== undefined) this.alertsHidden = hidden;
    this.topics.alerts.changed();
    for (const alert of list) {
      if (!before.has(alert.number)) this.alertListeners.forEach((listener) => listener(alert, "listed"));
    }
  }

  /** Takes the figures of known alerts from a state: they also change without an `alert_change`. */
  private renewAlerts(list: Alert[]): void {
    const differs = (alert: Alert): boolean => JSON.stringify(this.alerts.get(alert.number)) !== JSON.stringify(alert);
    const changed = list.filter((alert) => this.alerts.has(alert.number) && differs(alert));
    for (const alert of changed) this.alerts.set(alert.number, alert);
    if (changed.length > 0) this.topics.alerts.changed();
  }

  private takeAlertChange({ change, alert }: { change: string; alert: Alert }): void {
    this.alerts.set(alert.number, alert);
    const cleared = [...this.alerts.values()].filter((each) => each.state === "cleared");
    for (const old of cleared.slice(0, Math.max(0, cleared.length - MOST_CLEARED))) this.alerts.delete(old.number);
    this.topics.alerts.changed();
    this.alertListeners.forEach((listener) => listener(alert, change));
  }

  private takeNote(note: Note): void {
    const at = this.notes.findIndex((each) => each.number === note.number);
    if (at < 0) this.notes.push(note);
    else this.notes[at] = note;
    this.topics.notes.changed();
  }

  private tell(told: Told): void {
    this.told.push(told);
    if (this.told.length > MOST_TOLD) this.told.shift();
    this.topics.told.changed();
  }
}

function emptyHistory(): History {
  return { t_s: [], v_mps: [], v_max_mps: [], t_m: [] };
}

/** The page's one store. */
export const store = new Store();
