// Shapes that mean the same as the colours: circle for good, triangle for caution, octagon for stop, square for the end.
import type { Lamp } from "../feed/types";

export function Shape({ lamp, size = 24 }: { lamp: Lamp | "ended" | "none"; size?: number }) {
  return (
    <svg class={`shape ${lamp}`} width={size} height={size} viewBox="0 0 24 24" aria-hidden="true">
      {lamp === "green" ? <><circle cx="12" cy="12" r="10.5" /><path class="in" d="M6.5 12.5l4 4 7-8.5" /></> : null}
      {lamp === "amber" ? <><path d="M12 1.5L23 22H1z" /><path class="in" d="M12 8v7M12 17.5v2" /></> : null}
      {lamp === "red" ? <><path d="M7.5 1h9L23 7.5v9L16.5 23h-9L1 16.5v-9z" /><path class="in" d="M7.5 7.5l9 9M16.5 7.5l-9 9" /></> : null}
      {lamp === "ended" ? <><rect x="2" y="2" width="20" height="20" rx="2" /><path class="in" d="M8 8h8v8H8z" /></> : null}
      {lamp === "none" ? <circle class="hollow" cx="12" cy="12" r="9" /> : null}
    </svg>
  );
}
