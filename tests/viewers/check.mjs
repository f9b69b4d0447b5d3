// Reads a dive log with npm's @mcap/core, which Foxglove and Lichtblick use. Compares the log's summary and indexes
// with a full read of the file, and its schemas with those that Foxglove publishes (@foxglove/schemas).
//
//     node check.mjs LOG.mcap               prints differences, and exits with 1 if there are any
//     node check.mjs --self-test LOG.mcap   damages copies of the log, and checks that each damage is found
//
// Run it in a folder with the packages. Without them it prints "skipped" and exits with 0.

import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const packages = await load();
if (packages == undefined) {
  process.exit(0);
}
const { McapIndexedReader, McapStreamReader, loadDecompressHandlers, published } = packages;
const decompressHandlers = await loadDecompressHandlers();
const arguments_ = process.argv.slice(2);
const log = new Uint8Array(await readFile(arguments_.at(-1)));
process.exit(arguments_[0] === "--self-test" ? await selfTest(log) : await tell(log));

// Loads packages from the current folder.
async function load() {
  try {
    const require = createRequire(pathToFileURL(join(process.cwd(), "package.json")));
    const core = require("@mcap/core");
    const support = require("@mcap/support");
    return { ...core, loadDecompressHandlers: support.loadDecompressHandlers, published: require("@foxglove/schemas/jsonschema") };
  } catch (error) {
    console.log(`skipped: npm's @mcap/core, @mcap/support, @foxglove/schemas are not there (${error.message.split("\n")[0]})`);
    return undefined;
  }
}

// Summary computed by reading the data alone, from the first byte to the last.
function readThrough(bytes) {
  const reader = new McapStreamReader({ decompressHandlers, includeChunks: true });
  reader.append(bytes);
  const found = { messages: new Map(), channels: new Map(), schemas: new Map(), chunks: [], attachments: [], metadata: [], faults: [], times: [] };
  for (let record = reader.nextRecord(); record != undefined && record.type !== "DataEnd"; record = reader.nextRecord()) {
    switch (record.type) {
      case "Message":
        found.messages.set(record.channelId, (found.messages.get(record.channelId) ?? 0n) + 1n);
        found.times.push(record.logTime);
        found.faults.push(...messageFaults(record, found));
        break;
      case "Channel":
        found.channels.set(record.id, record);
        break;
      case "Schema":
        found.schemas.set(record.id, record);
        break;
      case "Chunk":
        found.chunks.push([record.messageStartTime, record.messageEndTime, record.uncompressedSize]);
        break;
      case "Attachment":
        found.attachments.push([record.name, BigInt(record.data.byteLength)]);
        break;
      case "Metadata":
        found.metadata.push(record.name);
        break;
    }
  }
  return found;
}

// Viewer messages that violate their schema, or whose data length differs from the stated one.
function messageFaults(message, { channels, schemas }) {
  const channel = channels.get(message.channelId);
  if (channel.messageEncoding !== "json") {
    return [];
  }
  const schema = schemas.get(channel.schemaId);
  if (schema?.encoding !== "jsonschema") {
    return [`${channel.topic}: JSON without a schema`];
  }
  schema.parsed ??= JSON.parse(new TextDecoder().decode(schema.data));
  const content = JSON.parse(new TextDecoder().decode(message.data));
  const faults = valueFaults(channel.topic, schema.parsed, content);
  const stride = content.point_stride ?? content.row_stride;
  if (stride != undefined && Buffer.from(content.data, "base64").length % stride !== 0) {
    faults.push(`${channel.topic}: data is no multiple of ${stride} bytes`);
  }
  return faults;
}

function valueFaults(place, schema, value) {
  const kind = Array.isArray(value) ? "array" : typeof value;
  if (kind !== (schema.type === "integer" ? "number" : schema.type)) {
    return [`${place} is ${kind} and should be ${schema.type}`];
  }
  if (kind === "array") {
    return value.flatMap((item, index) => valueFaults(`${place}[${index}]`, schema.items, item));
  }
  if (kind !== "object") {
    return [];
  }
  const lacking = schema.required.filter((key) => !(key in value)).map((key) => `${place} lacks ${key}`);
  const of = (key) =>
    key in schema.properties ? valueFaults(`${place}.${key}`, schema.properties[key], value[key]) : [`${place}.${key} is unknown`];
  return lacking.concat(Object.keys(value).flatMap(of));
}

// Differences in keys or types between our schemas and Foxglove's schemas of the same names.
function schemaFaults(place, ours, theirs) {
  const faults = [];
  // Foxglove's schemas give enumerations without a type.
  if (theirs.type != undefined && ours.type !== theirs.type) {
    faults.push(`${place}: type ${ours.type}, and Foxglove's is ${theirs.type}`);
  }
  for (const key of ["contentEncoding", "minimum", "maximum"]) {
    if (ours[key] !== theirs[key]) {
      faults.push(`${place}: ${key} ${ours[key]}, and Foxglove's is ${theirs[key]}`);
    }
  }
  const required = (schema) => [...(schema.required ?? [])].sort().join();
  if (theirs.required && required(ours) !== required(theirs)) {
    faults.push(`${place}: requires ${required(ours)}, and Foxglove's ${required(theirs)}`);
  }
  const names = (schema) => JSON.stringify((schema.oneOf ?? []).map((one) => [one.title, one.const]));
  if (names(ours) !== names(theirs)) {
    faults.push(`${place}: ${names(ours)}, and Foxglove's are ${names(theirs)}`);
  }
  for (const key of new Set([...Object.keys(ours.properties ?? {}), ...Object.keys(theirs.properties ?? {})])) {
    const [one, other] = [ours.properties?.[key], theirs.properties?.[key]];
    faults.push(...(one && other ? schemaFaults(`${place}.${key}`, one, other) : [`${place}: only ${one ? "ours" : "theirs"} has ${key}`]));
  }
  return ours.items ? faults.concat(schemaFaults(`${place}[]`, ours.items, theirs.items)) : faults;
}

function knownSchemaFaults(schemas) {
  const known = [...schemas.values()].filter((schema) => schema.name.startsWith("foxglove."));
  return known.flatMap((schema) => {
    const theirs = published[schema.name.slice("foxglove.".length)];
    const ours = JSON.parse(new TextDecoder().decode(schema.data));
    return theirs ? schemaFaults(schema.name, ours, theirs) : [`${schema.name}: Foxglove publishes no such schema`];
  });
}

async function check(bytes, deep) {
  const wrong = [];
  const text = (value) => JSON.stringify(value, (_, inner) => (typeof inner === "bigint" ? `${inner}` : inner));
  const same = (what, told, found) => {
    if (text(told) !== text(found)) {
      wrong.push(`${what}: the log says ${text(told)?.slice(0, 200)}, and there is ${text(found)?.slice(0, 200)}`);
    }
  };
  const found = readThrough(bytes);
  const readable = {
    size: async () => BigInt(bytes.byteLength),
    read: async (offset, size) => bytes.subarray(Number(offset), Number(offset + size)),
  };
  let reader;
  try {
    reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  } catch (error) {
    return { wrong: [`the summary can't be read: ${error.message}`], found };
  }
  const sorted = (map) => [...map].sort(([a], [b]) => a - b);
  const total = [...found.messages.values()].reduce((sum, count) => sum + count, 0n);
  const times = found.times.reduce(([least, most], time) => [time < least ? time : least, time > most ? time : most], [found.times[0], found.times[0]]);
  const stats = reader.statistics;
  same("statistics, messages", stats.messageCount, total);
  same("statistics, messages by channel", sorted(stats.channelMessageCounts), sorted(found.messages));
  same("statistics, times", [stats.messageStartTime, stats.messageEndTime], times);
  same("statistics, channels", stats.channelCount, found.channels.size);
  same("statistics, schemas", stats.schemaCount, found.schemas.size);
  same("statistics, chunks", stats.chunkCount, found.chunks.length);
  same("statistics, attachments", stats.attachmentCount, found.attachments.length);
  same("statistics, metadata", stats.metadataCount, found.metadata.length);
  const offset = (a, b) => (a.chunkStartOffset < b.chunkStartOffset ? -1 : 1);
  const chunks = [...reader.chunkIndexes].sort(offset);
  same("chunk indexes", chunks.map((chunk) => [chunk.messageStartTime, chunk.messageEndTime, chunk.uncompressedSize]), found.chunks);
  same("attachment index", reader.attachmentIndexes.map((index) => [index.name, index.dataSize]), found.attachments);
  same("metadata index", reader.metadataIndexes.map((index) => index.name), found.metadata);
  for (const channel of found.channels.values()) {
    same(`channel ${channel.topic}`, reader.channelsById.get(channel.id)?.topic, channel.topic);
  }
  wrong.push(...knownSchemaFaults(reader.schemasById), ...found.faults.slice(0, 20));
  if (deep) {
    const counts = new Map();
    for await (const message of reader.readMessages({ validateCrcs: true })) {
      counts.set(message.channelId, (counts.get(message.channelId) ?? 0n) + 1n);
    }
    same("messages by index", sorted(counts), sorted(found.messages));
  }
  return { wrong, found };
}

async function tell(bytes) {
  const { wrong, found } = await check(bytes, true);
  for (const channel of found.channels.values()) {
    const schema = found.schemas.get(channel.schemaId);
    const count = `${found.messages.get(channel.id) ?? 0n}`.padStart(8);
    console.log(`${count} ${channel.topic.padEnd(28)} ${channel.messageEncoding.padEnd(26)} ${schema?.name ?? "-"}`);
  }
  for (const line of wrong) {
    console.log(line);
  }
  console.log(`${found.chunks.length} chunks: ${wrong.length > 0 ? "DIFFERS" : "as told"}`);
  return wrong.length > 0 ? 1 : 0;
}

async function selfTest(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset);
  const first = new Map();
  for (let at = 8; at + 9 <= bytes.byteLength - 8; at += 9 + Number(view.getBigUint64(at + 1, true))) {
    const opcode = bytes[at];
    first.set(opcode, first.get(opcode) ?? at + 9);
  }
  // Opcodes and field positions: MCAP's specification, mcap.dev/spec. The summary's checksum is cleared (footer, byte
  // 16).
  const spoil = (change) => {
    const copy = bytes.slice();
    const field = new DataView(copy.buffer);
    field.setUint32(first.get(2) + 16, 0, true);
    change(field);
    return copy;
  };
  const more = (opcode, place) => spoil((copy) => copy.setBigUint64(first.get(opcode) + place, copy.getBigUint64(first.get(opcode) + place, true) + 1n, true));
  const text = new TextDecoder("latin1").decode(bytes);
  const summarySchema = text.lastIndexOf('"frame_id":');
  const cases = [
    ["statistics, messages:", more(11, 0)],
    ["chunk indexes:", more(8, 8)],
    ["attachment index:", more(10, 32)],
    ["statistics, metadata:", spoil((copy) => copy.setUint32(first.get(11) + 18, 9, true))],
    ["foxglove.", spoil((copy) => copy.setUint8(summarySchema + 1, "g".charCodeAt(0)))],
  ];
  let failed = 0;
  for (const [words, copy] of cases) {
    const hit = (await check(copy, false)).wrong.find((line) => line.startsWith(words));
    console.log(hit ? `spoilt: found ${hit.slice(0, 120)}` : `spoilt: NOT FOUND ${words}`);
    failed += hit ? 0 : 1;
  }
  return failed > 0 ? 1 : 0;
}
