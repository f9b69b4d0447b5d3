// Subscribes to a served replay with Foxglove's own client library, and checks that every topic has its schema and messages.
//
//     node foxglove.mjs HEADRACE LOG.mcap      in a folder with node_modules/@foxglove/ws-protocol
//
// Exits with 1 if anything is missing.

import { spawn } from "node:child_process";
import { createRequire } from "node:module";

const require = createRequire(`${process.cwd()}/`);
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const { WebSocket } = require("ws");

// The topics that docs/how-to/viewers/README.md describes.
const TOPICS = {
  transforms: "foxglove.FrameTransforms", pose: "foxglove.PoseInFrame", vehicle: "headrace.Vehicle", points: "foxglove.PointCloud",
  wall: "foxglove.Grid", sections: "headrace.Section", missed: "headrace.Missed", advice: "headrace.Advice", alerts: "foxglove.Log",
};
// The library uses the protocol name of an older server; the messages are the same.
const PROTOCOL = "foxglove.sdk.v1";
FoxgloveClient.SUPPORTED_SUBPROTOCOL = PROTOCOL;

const [program, log] = process.argv.slice(2);
const port = 20000 + (process.pid % 20000);
const dive = spawn(program, ["replay", log, "--speed", "8x", "--foxglove", `127.0.0.1:${port}`], { stdio: "ignore" });
const ended = new Promise((resolve) => dive.on("exit", resolve));
const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

async function connected() {
  for (let attempt = 0; attempt < 100; attempt += 1) {
    const socket = new WebSocket(`ws://127.0.0.1:${port}`, [PROTOCOL]);
    const open = await new Promise((resolve) => {
      socket.once("open", () => resolve(true));
      socket.once("error", () => resolve(false));
    });
    socket.terminate();
    if (open) return;
    await pause(100);
  }
  throw new Error("nobody serves there");
}

const faults = [];
const schemas = new Map();
const counts = new Map();
const topics = new Map();
let info;
let state;
await connected();
const socket = new WebSocket(`ws://127.0.0.1:${port}`, [PROTOCOL]);
socket.binaryType = "arraybuffer";
const client = new FoxgloveClient({ ws: socket });
client.on("error", (error) => {
  // This version of the library doesn't know playback state yet.
  const words = `${error.message ?? error}`;
  if (!words.endsWith("opcode in binary message: 5")) faults.push(words);
});
client.on("serverInfo", (told) => { info = told; });
client.on("advertise", (channels) => {
  for (const channel of channels) {
    schemas.set(channel.topic, channel);
    topics.set(client.subscribe(channel.id), channel);
  }
});
client.on("message", ({ subscriptionId, data }) => {
  const channel = topics.get(subscriptionId);
  counts.set(channel.topic, (counts.get(channel.topic) ?? 0) + 1);
  const content = JSON.parse(new TextDecoder().decode(data));
  const schema = JSON.parse(channel.schema);
  for (const key of schema.required ?? []) {
    if (!(key in content)) faults.push(`${channel.topic}: a message without ${key}`);
  }
});
// Playback state, which this version of the library doesn't know: opcode 5 of the server's binary messages.
socket.addEventListener("message", ({ data }) => {
  const view = typeof data === "string" ? undefined : new DataView(data);
  if (view?.getUint8(0) === 5) state = { status: view.getUint8(1), at: view.getBigUint64(2, true) };
});
// The first missed stretch is flagged after about twenty seconds of the dive.
const complete = () => Object.keys(TOPICS).every((name) => counts.has(`/result/view/${name}`));
for (const until = Date.now() + 60_000; Date.now() < until && !complete();) await pause(100);
for (const [name, schema] of Object.entries(TOPICS)) {
  const topic = `/result/view/${name}`;
  const channel = schemas.get(topic);
  if (channel?.schemaName !== schema || channel?.schemaEncoding !== "jsonschema") {
    faults.push(`${topic}: ${channel?.schemaName ?? "not advertised"}, expected ${schema}`);
  }
  const count = counts.get(topic) ?? 0;
  console.log(`${`${count}`.padStart(8)} ${topic.padEnd(28)} ${channel?.schemaName ?? "-"}`);
  if (count === 0) faults.push(`${topic}: no message`);
}
if (!info?.capabilities?.includes("playbackControl")) faults.push(`capabilities: ${info?.capabilities}`);
// A seek to the beginning, paused: opcode 3 of the client's binary messages.
const id = new TextEncoder().encode("back");
const request = new DataView(new ArrayBuffer(1 + 1 + 4 + 1 + 8 + 4 + id.length));
request.setUint8(0, 3);
request.setUint8(1, 1);
request.setFloat32(2, 8, true);
request.setUint8(6, 1);
const begun = info?.dataStartTime ?? { sec: 0, nsec: 0 };
const to = BigInt(begun.sec) * 1_000_000_000n + BigInt(begun.nsec) + 5_000_000_000n;
request.setBigUint64(7, to, true);
request.setUint32(15, id.length, true);
new Uint8Array(request.buffer).set(id, 19);
state = undefined;
socket.send(request.buffer);
await pause(2_000);
console.log(`playback: status ${state?.status} at ${state?.at} ns`);
// Playback is paused at the last 20 ms tick before the wanted time.
if (state?.status !== 1 || state.at > to || to - state.at > 20_000_000n) faults.push(`playback isn't paused at ${to} ns`);
socket.close();
dive.kill("SIGINT");
await ended;
for (const fault of [...new Set(faults)].slice(0, 20)) console.log(fault);
console.log(faults.length > 0 ? "DIFFERS" : "as it should be");
process.exit(faults.length > 0 ? 1 : 0);
