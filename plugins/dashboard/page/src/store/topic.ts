// A thing that changes, and who wants to know. Components are told once a frame, whatever has come since.
import { useEffect, useReducer } from "preact/hooks";

const due = new Set<Topic>();
let scheduled = false;

function tell(): void {
  scheduled = false;
  const now = [...due];
  due.clear();
  const listeners = new Set<() => void>();
  for (const topic of now) topic.each((listener) => listeners.add(listener));
  for (const listener of listeners) listener();
}

export class Topic {
  version = 0;
  private readonly listeners = new Set<() => void>();

  /** Something has changed. */
  changed(): void {
    this.version += 1;
    due.add(this);
    if (scheduled) return;
    scheduled = true;
    // Hidden pages get no frames; what sounds has to go on there.
    if (document.hidden) setTimeout(tell, 50);
    else requestAnimationFrame(tell);
  }

  on(listener: () => void): () => void {
    this.listeners.add(listener);
    return () => this.listeners.delete(listener);
  }

  each(call: (listener: () => void) => void): void {
    this.listeners.forEach(call);
  }
}

/** Draws the component again when any of these changes. */
export function useTopics(...topics: Topic[]): void {
  const [, again] = useReducer((count: number) => count + 1, 0);
  const seen = topics.map((topic) => topic.version).join();
  useEffect(() => {
    const listener = () => again(undefined);
    const offs = topics.map((topic) => topic.on(listener));
    // What changed between drawing and now.
    if (topics.map((topic) => topic.version).join() !== seen) listener();
    return () => offs.forEach((off) => off());
    // Topics are the page's own and never change.
  }, []);
}
