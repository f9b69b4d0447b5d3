// Plays a mock dive to the page in the feed's format. Tests control it by POST /mock/control with a JSON object.
import { createServer } from "node:http";
import { existsSync, readFileSync } from "node:fs";
import { extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";
import { WebSocketServer } from "ws";
import { SECTION_M, samplesBetween, samplesFrame, sectionsFrame } from "./dive.mjs";
import { World } from "./world.mjs";

const DIST = fileURLToPath(new URL("../dist/", import.meta.url));
const TYPES = { ".html": "text/html; charset=utf-8", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml" };
const CSP = "default-src 'self'; style-src 'self'; script-src 'self'; img-src 'self' data:; media-src 'self' blob:; connect-src 'self' ws: wss:; object-src 'none'; base-uri 'none'";
const KEPT = 2000;
const TICK_MS = 200;

/** Starts the server; port 0 takes a free one. */
export async function serve(options = {}) {
  let world = new World(options);
  const clients = new Set();
  let seq = 0, kept = [], sectionsTo = 0, mute = false, closed = false, token = options.token ?? null, refuses = null, spent = false, ended = false;

  const send = (message) => {
    seq += 1;
    const bytes = Buffer.isBuffer(message) ? (message.writeUInt32LE(seq, 8), message) : JSON.stringify({ ...message, seq });
    kept.push([seq, bytes]);
    if (kept.length > KEPT) kept.shift();
    if (!mute) clients.forEach((client) => client.send(bytes));
  };
  const sectionsNow = () => Math.ceil((world.at_m + 0.8) / SECTION_M);
  const whole = (client) => {
    const to = sectionsNow();
    client.send(JSON.stringify({ type: "alerts", list: world.alerts, hidden: 0, seq }));
    client.send(JSON.stringify({ type: "notes", list: world.notes, seq }));
    client.send(JSON.stringify({ ...world.history(), seq }));
    for (let from = 0; from < to; from += 4096) client.send(sectionsFrame(from, Math.min(to, from + 4096), world.at_m, seq));
    const recent = samplesBetween(Math.max(0, world.at_m - 2), world.at_m);
    client.send(samplesFrame(recent, seq));
    client.send(JSON.stringify({ ...world.back(), seq }));
    client.send(JSON.stringify({ ...world.state(), seq }));
    client.send(JSON.stringify({ type: "ready", seq }));
  };
  let tick = 0;
  const beat = () => {
    if (ended) return;
    const list = world.step(TICK_MS / 1000);
    for (const change of world.changes.splice(0)) send(change);
    if (list.length > 0) send(samplesFrame(list));
    const to = sectionsNow(), from = Math.max(0, Math.min(sectionsTo, to) - 8);
    if (to > from) send(sectionsFrame(from, to, world.at_m, 0));
    sectionsTo = to;
    if (tick++ % 5 === 0) send(world.back());
    send(world.state());
  };

  const play = ({ command, speed, to_s }) => {
    if (!world.playback) return "not a replay";
    if (command === "pause") world.playback.paused = true;
    else if (command === "go") world.playback.paused = false;
    else if (command === "speed") world.playback.speed = speed;
    else if (command === "seek") { world.t_s = to_s; world.at_m = Math.min(world.length_m, Math.max(1, to_s * 0.2)); sectionsTo = 0; }
    else { world.playback.paused = false; world.step(command === "step" ? 0.2 : 1.3); world.playback.paused = true; }
    send(world.state());
    return null;
  };
  const commanded = (client, text) => {
    const command = JSON.parse(text);
    const answer = (message) => client.send(JSON.stringify({ ...message, seq }));
    if (command.do === "rate") return answer({ type: "done", do: "rate" });
    if (command.do === "play") {
      const why = play(command);
      return answer(why ? { type: "refused", why } : { type: "done", do: "play" });
    }
    if (world.mode === "replay") return answer({ type: "refused", why: "a replay shows acknowledgements as they were" });
    if (command.do === "acknowledge") world.acknowledge(command.alert, command.by);
    else if (command.do === "silence") world.silence();
    else if (command.do === "note") world.note(command.text, command.by);
    else if (command.do === "mark") world.note("", command.by);
    else if (command.do === "voice") world.note("", command.by, { id: command.id, seconds: null });
    for (const change of world.changes.splice(0)) send(change);
    return answer({ type: "done", do: command.do });
  };

  /** Commands of tests. */
  const control = (ask) => {
    if (ask.speed_mps !== undefined) world.setSpeed(ask.speed_mps);
    if (ask.kill) world.kill(ask.kill);
    if (ask.position) world.position = ask.position;
    if (ask.missed_m !== undefined) world.missed(ask.missed_m);
    if (ask.raise) world.raise(ask.raise);
    if (ask.settle) world.settle((alert) => alert.kind === ask.settle);
    if (ask.condition) Object.assign(world, { condition: ask.condition, lamp: ask.lamp, remedy: ask.remedy ?? null });
    if (ask.recording) world.recording = ask.recording;
    if (ask.refuses !== undefined) refuses = ask.refuses;
    if (ask.mute !== undefined) mute = ask.mute;
    if (ask.closed !== undefined) { closed = ask.closed; if (closed) clients.forEach((client) => client.terminate()); }
    if (ask.token !== undefined) token = ask.token;
    if (ask.spent !== undefined) spent = ask.spent;
    if (ask.restart) { world = new World({ ...options, instance: ask.restart }); kept = []; sectionsTo = 0; clients.forEach((client) => client.terminate()); }
    if (ask.world) Object.assign(world, ask.world);
    if (ask.end) {
      world.over.ended = true;
      send(world.back());
      send(world.state());
      send({ type: "end", digest: "0", exit: 0, ...ask.end });
      ended = true;
    }
    return { alerts: world.alerts, notes: world.notes, at_m: world.at_m, playback: world.playback, clients: clients.size, seq };
  };

  // Path below which a proxy serves the program.
  const below = options.below ?? "";
  const allowed = (request) => token === null || (request.headers.cookie ?? "").includes(`mock=${token}`);
  const http = createServer((request, response) => {
    const url = new URL(request.url, "http://localhost");
    const answer = (code, type, body, more = {}) => {
      response.writeHead(code, { "content-type": type, "content-security-policy": CSP, ...more });
      response.end(body);
    };
    if (url.pathname === "/mock/control") {
      let body = "";
      request.on("data", (part) => (body += part));
      request.on("end", () => answer(200, "application/json", JSON.stringify(control(JSON.parse(body || "{}")))));
      return undefined;
    }
    if (closed) return request.socket.destroy();
    if (!url.pathname.startsWith(`${below}/`)) return answer(404, "text/plain", "not found");
    url.pathname = url.pathname.slice(below.length).replace(/^\/widget(?=\/assets\/)/, "");
    if (url.pathname === "/login") {
      if (spent) return answer(429, "text/plain", "too many wrong tokens");
      const right = url.searchParams.get("token") === token;
      return answer(right ? 204 : 401, "text/plain", "", right ? { "set-cookie": `mock=${token}; Path=/; HttpOnly; SameSite=Strict` } : {});
    }
    if (url.pathname === "/samples" || url.pathname === "/state.json") {
      if (!allowed(request)) return answer(401, "text/plain", "a token is needed");
      if (url.pathname === "/state.json") return answer(200, "application/json", JSON.stringify(world.state()));
      const from = Math.max(0, Number(url.searchParams.get("from_m"))), to = Math.min(world.at_m, Number(url.searchParams.get("to_m")));
      return answer(200, "application/octet-stream", samplesFrame(samplesBetween(from, to), seq));
    }
    if (url.pathname.startsWith("/voice/")) {
      const id = Number(url.pathname.slice("/voice/".length));
      if (request.method === "GET") {
        const sound = world.voices.get(id);
        return sound ? answer(200, "audio/webm", sound) : answer(404, "text/plain", "no voice note of this id has a recording");
      }
      const parts = [];
      request.on("data", (part) => parts.push(part));
      request.on("end", () => {
        if (refuses) return answer(503, "application/json", JSON.stringify({ type: "refused", why: refuses }));
        world.spoken(id, Number(url.searchParams.get("seconds")), Buffer.concat(parts));
        for (const change of world.changes.splice(0)) send(change);
        return answer(200, "application/json", "{}");
      });
      return undefined;
    }
    const name = url.pathname === "/" || url.pathname.startsWith("/widget/") ? "index.html" : normalize(url.pathname).replace(/^[/\\]+/, "");
    const file = join(DIST, name);
    if (!file.startsWith(DIST) || !existsSync(file)) return answer(404, "text/plain", "not found");
    return answer(200, TYPES[extname(file)] ?? "application/octet-stream", readFileSync(file));
  });
  const sockets = new WebSocketServer({ noServer: true, handleProtocols: () => "headrace.feed.1" });
  http.on("upgrade", (request, socket, head) => {
    if (closed || !request.url.startsWith(`${below}/feed`)) return socket.destroy();
    if (!allowed(request)) return socket.end("HTTP/1.1 401 Unauthorized\r\nconnection: close\r\n\r\n");
    sockets.handleUpgrade(request, socket, head, (client) => {
      const query = new URL(request.url, "http://localhost").searchParams;
      const since = Number(query.get("since"));
      client.send(JSON.stringify({ ...world.hello(), seq }));
      if (query.get("instance") === world.instance && (kept[0]?.[0] ?? Infinity) <= since + 1) {
        kept.filter(([number]) => number > since).forEach(([, bytes]) => client.send(bytes));
        client.send(JSON.stringify({ type: "ready", seq }));
      } else whole(client);
      clients.add(client);
      client.on("message", (text) => commanded(client, String(text)));
      client.on("close", () => clients.delete(client));
    });
  });
  const timer = setInterval(beat, TICK_MS);
  await new Promise((resolve) => http.listen(options.port ?? 0, "127.0.0.1", resolve));
  const port = http.address().port;
  return {
    port, url: `http://127.0.0.1:${port}`, control,
    async close() {
      clearInterval(timer);
      clients.forEach((client) => client.terminate());
      await new Promise((resolve) => { http.close(resolve); http.closeAllConnections(); });
    },
  };
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const argument = (name, or) => { const at = process.argv.indexOf(`--${name}`); return at < 0 ? or : process.argv[at + 1]; };
  const length_m = Number(argument("length", 7000)), at_m = Number(argument("at", length_m - 10));
  const running = await serve({ port: Number(argument("port", 8890)), length_m, at_m, mode: argument("mode", "demo") });
  console.log(running.url);
}
