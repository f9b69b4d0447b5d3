// A value that changes, with its subscribers. Subscribers are notified once per animation frame, however often the
// value changes.
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

  /** Reports a change. */
  changed(): void {
    this.version += 1;
    due.add(this);
    if (scheduled) return;
    scheduled = true;
    // A hidden page gets no animation frames, but its sounds must continue.
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

/** Renders the component again when any of these topics changes. */
export function useTopics(...topics: Topic[]): void {
  const [, again] = useReducer((count: number) => count + 1, 0);
  const seen = topics.map((topic) => topic.version).join();
  useEffect(() => {
    const listener = () => again(undefined);
    const offs = topics.map((topic) => topic.on(listener));
    // A topic may have changed between rendering and this effect.
    if (topics.map((topic) => topic.version).join() !== seen) listener();
    return () => offs.forEach((off) => off());
    // No dependencies: a component's topics never change.
  }, []);
}
