// WebGL2 shaders of the wall.
import { CIVIDIS, rgb, TOP_RATIO } from "./cividis";
import { ABSENT, FLAGGED_BIT, RATIO_STEPS } from "./columns";

const stops = CIVIDIS.map((hex) => `vec3(${rgb(hex).map((part) => part.toFixed(4)).join(",")})`).join(",");

const COMMON = `#version 300 es
precision highp float;
precision highp int;
precision highp usampler2D;
uniform usampler2D u_columns;
uniform vec2 u_origin;   // lower left of the drawn part, pixels
uniform vec2 u_size;     // its size, pixels
uniform float u_crown;   // fraction of the perimeter at the crown
uniform float u_sign;    // 1 where arc length grows downwards
uniform float u_middle;  // fraction of the round in the middle of the height
uniform float u_zoom;    // heights of one round
uniform float u_gain;    // brightness of colours
uniform float u_scale;   // device pixels of a CSS pixel
uniform vec3 u_blank, u_open, u_missed, u_flag, u_hatch, u_grey;
const vec3 stops[10] = vec3[10](${stops});
vec3 cividis(float share) {
  float at = clamp(share, 0.0, 1.0) * 9.0;
  int low = min(int(at), 8);
  return mix(stops[low], stops[low + 1], at - float(low)) * u_gain;
}
vec3 byRatio(uint state) { return cividis(float(state >> 16) / ${RATIO_STEPS}.0 / ${TOP_RATIO}.0); }
bool stripe(vec2 place, float every, float width) { return mod(place.x + place.y, every * u_scale) < width * u_scale; }
`;

export const FULL_VERTEX = `#version 300 es
void main() {
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  gl_Position = vec4(corner * 2.0 - 1.0, 0.9, 1.0);
}`;

/** Draws columns, coloured by verdict, D / T and coverage. */
export const WALL_FRAGMENT = `${COMMON}
uniform bool u_discs;
out vec4 colour;
void main() {
  vec2 place = gl_FragCoord.xy - u_origin;
  uvec4 column = texelFetch(u_columns, ivec2(int(place.x), 0), 0);
  uint verdict = column.x & 7u;
  float down = (1.0 - place.y / u_size.y - 0.5) / u_zoom + u_middle;
  float arc = fract(u_crown + u_sign * down);
  int bin = int(arc * 64.0);
  uint word = bin < 32 ? column.y : column.z;
  bool seen = ((word >> uint(bin & 31)) & 1u) == 1u;
  if (verdict == ${ABSENT}u) { colour = vec4(u_blank, 1.0); return; }
  bool judged = verdict != 0u && verdict != 4u;
  if (u_discs) {
    vec3 missed = stripe(place * vec2(1.0, -1.0), 7.0, 2.5) ? u_missed : mix(u_blank, u_missed, 0.35);
    colour = vec4(judged ? missed : u_open, 1.0);
    return;
  }
  vec3 its = byRatio(column.x);
  if (!judged) its = mix(u_open, its, 0.45);
  colour = vec4(seen ? its : (judged ? u_blank : u_open), 1.0);
}`;

/** Draws over columns and discs: hatches for "can't say" and "not inspected", and the outline of flagged sections. */
export const MARKS_FRAGMENT = `${COMMON}
out vec4 colour;
uint stateAt(float x) { return texelFetch(u_columns, ivec2(int(clamp(x, 0.0, u_size.x - 1.0)), 0), 0).x; }
void main() {
  vec2 place = gl_FragCoord.xy - u_origin;
  uint state = stateAt(place.x);
  uint verdict = state & 7u;
  if ((state & ${FLAGGED_BIT}u) != 0u) {
    float border = 2.0 * u_scale;
    bool side = (stateAt(place.x - border) & ${FLAGGED_BIT}u) == 0u || (stateAt(place.x + border) & ${FLAGGED_BIT}u) == 0u;
    bool edge = place.y < border * 1.5 || place.y > u_size.y - border * 1.5;
    if (side || edge) { colour = vec4(u_flag, 1.0); return; }
  }
  if (verdict == 3u && stripe(place, 9.0, 2.5)) { colour = vec4(u_hatch, 1.0); return; }
  if (verdict == 4u && stripe(place * vec2(1.0, -1.0), 9.0, 2.5)) { colour = vec4(u_grey, 1.0); return; }
  discard;
}`;

const SAMPLE_COMMON = `
uniform float u_left_m;   // left edge, metres from the window's origin
uniform float u_per_m;    // pixels a metre
uniform float u_shift;    // rounds that this drawing is shifted by
vec2 placed(float x, float down) {
  return vec2((x - u_left_m) * u_per_m, (0.5 - (down + u_shift - u_middle) * u_zoom) * u_size.y);
}
`;

export const DISC_VERTEX = `${COMMON}${SAMPLE_COMMON}
layout(location = 0) in vec4 a_sample; // x, fraction of the round from the crown, time, head + 16 outcome
uniform vec2 u_radius;                 // pixels
out vec2 v_corner;
void main() {
  v_corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
  vec2 at = placed(a_sample.x, a_sample.y) + v_corner * u_radius;
  bool wall = a_sample.w < 16.0;
  gl_Position = wall ? vec4(at / u_size * 2.0 - 1.0, 0.5, 1.0) : vec4(3.0, 3.0, 0.0, 1.0);
}`;

/** Draws small discs as points, which need one vertex instead of four. */
export const POINT_DISC_VERTEX = `${COMMON}${SAMPLE_COMMON}
layout(location = 0) in vec4 a_sample;
uniform vec2 u_radius;
void main() {
  bool wall = a_sample.w < 16.0;
  vec2 at = placed(a_sample.x, a_sample.y);
  gl_PointSize = 2.0 * max(u_radius.x, u_radius.y);
  gl_Position = wall ? vec4(at / u_size * 2.0 - 1.0, 0.5, 1.0) : vec4(3.0, 3.0, 0.0, 1.0);
}`;

const discFragment = (corner: string, input: string): string => `${COMMON}
${input}
out vec4 colour;
void main() {
  vec2 corner = ${corner};
  if (dot(corner, corner) > 1.0) discard;
  uint state = texelFetch(u_columns, ivec2(int(gl_FragCoord.x - u_origin.x), 0), 0).x;
  uint verdict = state & 7u;
  vec3 its = byRatio(state);
  bool judged = verdict == 1u || verdict == 2u || verdict == 3u;
  colour = vec4(judged ? its : mix(u_open, cividis(0.35), 0.7), 1.0);
}`;
export const DISC_FRAGMENT = discFragment("v_corner", "in vec2 v_corner;");
export const POINT_DISC_FRAGMENT = discFragment("(gl_PointCoord * 2.0 - 1.0) * max(u_radius.x, u_radius.y) / u_radius", "uniform vec2 u_radius;");

export const DOT_VERTEX = `${COMMON}${SAMPLE_COMMON}
layout(location = 0) in vec4 a_sample;
uniform float u_point;      // pixels
uniform bool u_all;         // dots of all turns, or of the present one
uniform float u_turn_t_s[16]; // where each head's present turn begins
uniform float u_now_s;        // time shown; a file has later samples
out float v_kind;
void main() {
  vec2 at = placed(a_sample.x, a_sample.y);
  int head = int(mod(a_sample.w, 16.0));
  bool present = a_sample.z >= u_turn_t_s[head] && a_sample.z <= u_now_s;
  float outcome = floor(a_sample.w / 16.0);
  v_kind = outcome > 0.0 ? 2.0 : present ? 1.0 : 0.0;
  gl_PointSize = present ? u_point + 2.5 * u_scale : u_point;
  gl_Position = present || u_all ? vec4(at / u_size * 2.0 - 1.0, 0.3, 1.0) : vec4(3.0, 3.0, 0.0, 1.0);
}`;

export const DOT_FRAGMENT = `${COMMON}
in float v_kind;
uniform vec3 u_dot, u_new;
out vec4 colour;
void main() {
  vec2 corner = gl_PointCoord * 2.0 - 1.0;
  float off = dot(corner, corner);
  if (off > 1.0) discard;
  if (v_kind > 1.5) { if (off < 0.2) discard; colour = vec4(off < 0.6 ? u_hatch : u_dot, 1.0); return; }
  colour = vec4(v_kind > 0.5 ? u_new : u_dot, 1.0);
}`;
