// A time for people: dive time, with UTC in the tooltip.
import { store } from "../store/store";
import { clock } from "../text/format";
import { utcOf } from "../text/times";

export function Time({ at_s, more = "" }: { at_s: number; more?: string }) {
  const title = [utcOf(store.hello, at_s), more].filter((part) => part !== "").join(", ");
  return <time title={title === "" ? undefined : title}>{clock(at_s)}</time>;
}
