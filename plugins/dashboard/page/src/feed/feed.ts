// The WebSocket connection to the program. It resumes after a drop, and backs off while the program does not answer.
import type { Store } from "../store/store";
import { frameOf } from "./binary";
import type { Command, Message } from "./types";

const SUBPROTOCOL = "headrace.feed.1";
const BACKOFF_MS = [250, 500, 1000, 2000, 4000];
/** A connection without data for this long counts as dead and is reopened. */
const SILENT_MS = 10_000;

export class Feed {
  private socket: WebSocket | null = null;
  private retry = 0;
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(private readonly store: Store, private readonly base: URL) {}

  start(): void {
    this.connect();
    addEventListener("online", () => this.again());
    setInterval(() => this.watch(), 1000);
  }

  /** Connects at once, without waiting for the backoff. */
  again(): void {
    if (this.socket && this.socket.readyState <= WebSocket.OPEN && this.store.link.phase === "open") return;
    this.retry = 0;
    this.drop();
    this.connect();
  }

  send(command: Command): boolean {
    if (this.socket?.readyState !== WebSocket.OPEN) {
      this.store.answered("not sent: not connected to the program", true);
      return false;
    }
    this.socket.send(JSON.stringify(command));
    return true;
  }

  /** Sends the token, which the server stores as a cookie. Returns the reason of a refusal, or an empty text. */
  async login(token: string): Promise<string> {
    const url = new URL("login", this.base);
    url.searchParams.set("token", token);
    const response = await fetch(url, { redirect: "manual", credentials: "same-origin" });
    if (response.status === 429) return "Too many wrong tokens from here: wait some seconds and try again.";
    if (response.status >= 400) return "This token is wrong.";
    this.store.link.phase = "connecting";
    this.again();
    return "";
  }

  private connect(): void {
    clearTimeout(this.timer);
    const url = new URL("feed", this.base);
    url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
    if (this.store.instance !== "") {
      url.searchParams.set("instance", this.store.instance);
      url.searchParams.set("since", String(this.store.seq));
    }
    let socket: WebSocket;
    try {
      socket = new WebSocket(url, SUBPROTOCOL);
    } catch (error) {
      this.lost(String(error));
      return;
    }
    socket.binaryType = "arraybuffer";
    socket.onopen = () => this.opened();
    socket.onmessage = (event) => this.heard(event.data as string | ArrayBuffer);
    socket.onclose = (event) => {
      if (this.socket === socket) void this.closed(event.reason);
    };
    this.socket = socket;
  }

  private drop(): void {
    const socket = this.socket;
    this.socket = null;
    socket?.close();
  }

  private opened(): void {
    this.retry = 0;
    const { link } = this.store;
    link.heard_ms = performance.now();
    this.phase("open", "");
    link.tries = 0;
  }

  private heard(data: string | ArrayBuffer): void {
    this.store.link.heard_ms = performance.now();
    try {
      if (typeof data === "string") this.store.take(JSON.parse(data) as Message);
      else this.store.takeFrame(frameOf(data));
    } catch (error) {
      this.store.answered(`a message of the feed can't be read: ${String(error)}`, true);
    }
  }

  /** A socket that can't be opened gives no reason, so /state.json is requested to find out whether a token is needed. */
  private async closed(reason: string): Promise<void> {
    const opened = this.store.link.phase === "open";
    this.lost(reason);
    if (opened) return;
    try {
      const response = await fetch(new URL("state.json", this.base), { credentials: "same-origin" });
      if (response.status === 401 && this.store.link.phase !== "open") {
        clearTimeout(this.timer);
        this.phase("refused", "");
      }
    } catch {
      // The program does not answer at all, so the timer's next attempt stays scheduled.
    }
  }

  private lost(why: string): void {
    this.socket = null;
    this.phase("lost", why);
    this.store.link.tries += 1;
    const wait_ms = BACKOFF_MS[Math.min(this.retry, BACKOFF_MS.length - 1)] ?? 4000;
    this.retry += 1;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.connect(), wait_ms);
  }

  private watch(): void {
    const { link } = this.store;
    if (link.phase !== "open" || performance.now() - link.heard_ms < SILENT_MS) return;
    this.drop();
    this.lost(`no data for ${SILENT_MS / 1000} s`);
  }

  private phase(phase: Store["link"]["phase"], why: string): void {
    const { link } = this.store;
    if (link.phase !== phase) link.since_ms = performance.now();
    link.phase = phase;
    link.why = why;
    this.store.topics.link.changed();
  }
}
