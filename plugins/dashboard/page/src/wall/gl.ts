// Draws the wall with WebGL2, only on request. It uploads only the visible columns, and each sample only once.
import { rgb } from "./cividis";
import { WORDS } from "./columns";
import { FLOATS, type SampleWindow } from "./samples";
import { DISC_FRAGMENT, DISC_VERTEX, DOT_FRAGMENT, DOT_VERTEX, FULL_VERTEX, MARKS_FRAGMENT, POINT_DISC_FRAGMENT, POINT_DISC_VERTEX, WALL_FRAGMENT } from "./shaders";
import type { Round, View } from "./view";

export interface WallColours { blank: string; open: string; missed: string; flag: string; hatch: string; grey: string; dot: string; fresh: string; gain: number }

/** A part of the canvas, in device pixels from the canvas's lower left corner. */
export interface Part { x: number; y: number; width: number; height: number }

export interface Drawing {
  part: Part; columns: Uint32Array; view: View; round: Round; scale: number;
  discs: { samples: SampleWindow; radius_m: number; perimeter_m: number; turn_t_s: Float32Array; now_s: number } | null;
}

/** Discs of a smaller radius, CSS pixels, are drawn as points. */
const SMALL_DISC = 9;

/** Repetitions of the perimeter that are at least partly visible. */
function rounds({ centreDown, zoomDown }: View): number[] {
  const half = 0.5 / zoomDown;
  return [-1, 0, 1].filter((shift) => centreDown + half > shift + 1e-6 && centreDown - half < shift + 1 - 1e-6);
}

class Program {
  readonly program: WebGLProgram;
  private readonly places = new Map<string, WebGLUniformLocation | null>();

  constructor(private readonly gl: WebGL2RenderingContext, vertex: string, fragment: string) {
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]] as const) {
      const shader = gl.createShader(kind);
      if (!shader) throw new Error("WebGL2 context lost");
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
        throw new Error(`wall shader: ${gl.getShaderInfoLog(shader) ?? ""}`);
      }
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      throw new Error(`wall shader: ${gl.getProgramInfoLog(program) ?? ""}`);
    }
    this.program = program;
  }

  at(name: string): WebGLUniformLocation | null {
    let place = this.places.get(name);
    if (place === undefined) this.places.set(name, (place = this.gl.getUniformLocation(this.program, name)));
    return place;
  }
}

export class WallGl {
  private readonly gl: WebGL2RenderingContext;
  private wall!: Program;
  private marks!: Program;
  private discs!: Program;
  private pointDiscs!: Program;
  private dots!: Program;
  private buffer!: WebGLBuffer;
  private instanced!: WebGLVertexArrayObject;
  private points!: WebGLVertexArrayObject;
  private empty!: WebGLVertexArrayObject;
  private readonly textures = new Map<string, { texture: WebGLTexture; width: number }>();
  private uploadedFrom: SampleWindow | null = null;

  /** Fails without WebGL2. */
  constructor(canvas: HTMLCanvasElement) {
    const gl = canvas.getContext("webgl2", { antialias: false, alpha: false, depth: true, powerPreference: "low-power" });
    if (!gl) throw new Error("this browser has no WebGL2");
    this.gl = gl;
    this.make();
  }

  /** Recreates everything after the context was lost. */
  make(): void {
    const gl = this.gl;
    this.wall = new Program(gl, FULL_VERTEX, WALL_FRAGMENT);
    this.marks = new Program(gl, FULL_VERTEX, MARKS_FRAGMENT);
    this.discs = new Program(gl, DISC_VERTEX, DISC_FRAGMENT);
    this.pointDiscs = new Program(gl, POINT_DISC_VERTEX, POINT_DISC_FRAGMENT);
    this.dots = new Program(gl, DOT_VERTEX, DOT_FRAGMENT);
    this.buffer = gl.createBuffer();
    this.textures.clear();
    this.uploadedFrom = null;
    this.empty = gl.createVertexArray();
    this.instanced = this.vertices(1);
    this.points = this.vertices(0);
  }

  begin(colours: WallColours): void {
    const gl = this.gl;
    const [red, green, blue] = rgb(colours.blank);
    gl.disable(gl.SCISSOR_TEST);
    gl.clearColor(red, green, blue, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  }

  draw(name: string, drawing: Drawing, colours: WallColours): void {
    const gl = this.gl;
    const { part, discs } = drawing;
    gl.viewport(part.x, part.y, part.width, part.height);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(part.x, part.y, part.width, part.height);
    this.columns(name, drawing.columns, part.width);
    gl.disable(gl.DEPTH_TEST);
    gl.bindVertexArray(this.empty);
    this.use(this.wall, drawing, colours);
    gl.uniform1i(this.wall.at("u_discs"), discs ? 1 : 0);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    if (discs) this.drawDiscs(drawing, colours);
    gl.bindVertexArray(this.empty);
    this.use(this.marks, drawing, colours);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    if (discs) this.drawDots(drawing, colours);
  }

  private drawDiscs(drawing: Drawing, colours: WallColours): void {
    const gl = this.gl, discs = drawing.discs, { part, view } = drawing;
    if (!discs) return;
    this.upload(discs.samples);
    const across = (discs.radius_m / view.span_m) * part.width;
    const down = (discs.radius_m / discs.perimeter_m) * part.height * view.zoomDown;
    const small = Math.max(across, down) < SMALL_DISC * drawing.scale;
    const program = small ? this.pointDiscs : this.discs;
    this.use(program, drawing, colours);
    this.place(program, drawing);
    gl.uniform2f(program.at("u_radius"), across, down);
    // The depth test skips pixels that another disc already covers.
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LESS);
    gl.bindVertexArray(small ? this.points : this.instanced);
    // The window already holds samples near the seam twice. Further repetitions of the perimeter are drawn only if
    // the view is taller than one perimeter.
    for (const shift of rounds(view)) {
      gl.uniform1f(program.at("u_shift"), shift);
      if (small) gl.drawArrays(gl.POINTS, 0, discs.samples.count);
      else gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, discs.samples.count);
    }
    gl.disable(gl.DEPTH_TEST);
  }

  private drawDots(drawing: Drawing, colours: WallColours): void {
    const gl = this.gl, discs = drawing.discs;
    if (!discs) return;
    this.use(this.dots, drawing, colours);
    this.place(this.dots, drawing);
    const radius = (discs.radius_m / drawing.view.span_m) * drawing.part.width;
    const down = (discs.radius_m / discs.perimeter_m) * drawing.part.height * drawing.view.zoomDown;
    // In a wide view the dots would hide the discs, so only dots of the present turn are drawn.
    gl.uniform1i(this.dots.at("u_all"), Math.min(radius, down) > 4 * drawing.scale ? 1 : 0);
    gl.uniform1f(this.dots.at("u_point"), Math.min(Math.max(radius / 6, 1), 3.5 * drawing.scale));
    gl.uniform1fv(this.dots.at("u_turn_t_s"), discs.turn_t_s);
    gl.uniform1f(this.dots.at("u_now_s"), discs.now_s);
    gl.uniform3fv(this.dots.at("u_dot"), rgb(colours.dot));
    gl.uniform3fv(this.dots.at("u_new"), rgb(colours.fresh));
    gl.bindVertexArray(this.points);
    for (const shift of rounds(drawing.view)) {
      gl.uniform1f(this.dots.at("u_shift"), shift);
      gl.drawArrays(gl.POINTS, 0, discs.samples.count);
    }
  }

  private place(program: Program, { part, view, discs }: Drawing): void {
    const gl = this.gl;
    gl.uniform1f(program.at("u_left_m"), view.centre_m - view.span_m / 2 - (discs?.samples.origin_m ?? 0));
    gl.uniform1f(program.at("u_per_m"), part.width / view.span_m);
  }

  private use(program: Program, { part, view, round, scale }: Drawing, colours: WallColours): void {
    const gl = this.gl;
    gl.useProgram(program.program);
    gl.uniform1i(program.at("u_columns"), 0);
    gl.uniform2f(program.at("u_origin"), part.x, part.y);
    gl.uniform2f(program.at("u_size"), part.width, part.height);
    gl.uniform1f(program.at("u_crown"), round.crown);
    gl.uniform1f(program.at("u_sign"), round.sign);
    gl.uniform1f(program.at("u_middle"), view.centreDown);
    gl.uniform1f(program.at("u_zoom"), view.zoomDown);
    gl.uniform1f(program.at("u_scale"), scale);
    gl.uniform1f(program.at("u_gain"), colours.gain);
    for (const name of ["blank", "open", "missed", "flag", "hatch", "grey"] as const) {
      gl.uniform3fv(program.at(`u_${name}`), rgb(colours[name]));
    }
  }

  private columns(name: string, words: Uint32Array, width: number): void {
    const gl = this.gl;
    let held = this.textures.get(name);
    if (!held) {
      held = { texture: gl.createTexture(), width: 0 };
      this.textures.set(name, held);
    }
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, held.texture);
    const data = words.subarray(0, width * WORDS);
    if (held.width === width) {
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, 1, gl.RGBA_INTEGER, gl.UNSIGNED_INT, data);
      return;
    }
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32UI, width, 1, 0, gl.RGBA_INTEGER, gl.UNSIGNED_INT, data);
    for (const parameter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, parameter, gl.NEAREST);
    for (const parameter of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, parameter, gl.CLAMP_TO_EDGE);
    held.width = width;
  }

  /** Uploads only new data. */
  private upload(samples: SampleWindow): void {
    const gl = this.gl;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    if (this.uploadedFrom !== samples) {
      gl.bufferData(gl.ARRAY_BUFFER, samples.data.byteLength, gl.DYNAMIC_DRAW);
      this.uploadedFrom = samples;
      samples.uploaded = 0;
    }
    if (samples.uploaded < samples.count) {
      const from = samples.uploaded * FLOATS;
      gl.bufferSubData(gl.ARRAY_BUFFER, from * 4, samples.data, from, samples.count * FLOATS - from);
      samples.uploaded = samples.count;
    }
  }

  private vertices(divisor: number): WebGLVertexArrayObject {
    const gl = this.gl;
    const vertices = gl.createVertexArray();
    gl.bindVertexArray(vertices);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, FLOATS, gl.FLOAT, false, FLOATS * 4, 0);
    gl.vertexAttribDivisor(0, divisor);
    return vertices;
  }
}
