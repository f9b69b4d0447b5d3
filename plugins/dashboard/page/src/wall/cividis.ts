// The colour map cividis in ten equal steps (Nunez, Anderton, Renslow 2018), readable with and without red and green.
export const CIVIDIS = ["#00224e", "#123570", "#3b496c", "#575d6d", "#707173", "#8a8678", "#a59c74", "#c3b369", "#e1cc55", "#fee838"];

/** D / T at the end of the map; T is in its middle. */
export const TOP_RATIO = 2;

/** Parts of #rrggbb or #rgb, 0 to 1. */
export function rgb(hex: string): [number, number, number] {
  // Minified style sheets contain #rgb where possible.
  const six = hex.length === 4 ? [...hex.slice(1)].map((digit) => digit + digit).join("") : hex.slice(1);
  const value = parseInt(six, 16);
  return [(value >> 16) / 255, ((value >> 8) & 255) / 255, (value & 255) / 255];
}
