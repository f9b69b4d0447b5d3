// The colour map cividis in ten equal steps (Nunez, Anderton, Renslow 2018). It is readable with red-green colour
// blindness.
export const CIVIDIS = ["#00224e", "#123570", "#3b496c", "#575d6d", "#707173", "#8a8678", "#a59c74", "#c3b369", "#e1cc55", "#fee838"];

/** Ratio D / T at the end of the map. D = T is in the middle of the map. */
export const TOP_RATIO = 2;

/** Red, green and blue of #rrggbb or #rgb, each 0 to 1. */
export function rgb(hex: string): [number, number, number] {
  // A minified style sheet shortens #rrggbb to #rgb where possible.
  const six = hex.length === 4 ? [...hex.slice(1)].map((digit) => digit + digit).join("") : hex.slice(1);
  const value = parseInt(six, 16);
  return [(value >> 16) / 255, ((value >> 8) & 255) / 255, (value & 255) / 255];
}
