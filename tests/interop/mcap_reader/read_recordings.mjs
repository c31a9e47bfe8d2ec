// Reads the recordings in a folder with @mcap/core and the OMG IDL and CDR packages of its family, twice each (by the
// index and as a stream, which checks every CRC), and compares each message with the values beside it.
// Call: node read_recordings.mjs FOLDER
import { readFileSync } from "node:fs";
import { open } from "node:fs/promises";
import path from "node:path";

import { parseIDL } from "@foxglove/omgidl-parser";
import { MessageReader } from "@foxglove/omgidl-serialization";
import * as lz4 from "@foxglove/wasm-lz4";
import * as zstd from "@foxglove/wasm-zstd";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";

const unpackLz4 = lz4.default ?? lz4;
const unpackZstd = zstd.default ?? zstd;
await unpackLz4.isLoaded;
await unpackZstd.isLoaded;
const decompressHandlers = {
  lz4: (buffer, size) => unpackLz4(buffer, Number(size)),
  zstd: (buffer, size) => unpackZstd.decompress(buffer, Number(size)),
};

const failures = [];
function expect(condition, what) {
  if (!condition && failures.push(what) > 10) throw new Error(failures.join("\n"));
}

/// Whole numbers that a double cannot hold become texts, to be compared digit by digit.
function parseExpected(line) {
  return JSON.parse(line.replace(/([:[,])(-?\d{16,})(?=[,}\]])/g, '$1"$2"'));
}

function same(expected, got, enumerators, where) {
  if (typeof got === "bigint") return expect(String(expected) === String(got), `${where}: ${expected} != ${got}`);
  // This reader gives enumerators and characters by their numbers.
  if (typeof got === "number" && typeof expected === "string")
    return expect((enumerators.get(expected) ?? expected.charCodeAt(0)) === got, `${where}: ${expected} is not ${got}`);
  if (got !== null && typeof got === "object") {
    const list = Array.isArray(got) || ArrayBuffer.isView(got);
    expect(list === Array.isArray(expected), `${where}: a list on one side only`);
    const keys = Object.keys(expected);
    expect(keys.length === Object.keys(got).length, `${where}: ${keys} != ${Object.keys(got)}`);
    for (const key of keys) same(expected[key], got[key], enumerators, `${where}.${key}`);
    return;
  }
  expect(Object.is(expected, got) || expected === got, `${where}: ${expected} != ${got}`);
}

function decoder(schema) {
  expect(schema.encoding === "omgidl", `${schema.name}: encoding ${schema.encoding}`);
  const definitions = parseIDL(new TextDecoder().decode(schema.data));
  const enumerators = new Map();
  for (const definition of definitions)
    for (const { name, value } of definition.definitions ?? []) if (value !== undefined) enumerators.set(name, value);
  return { reader: new MessageReader(schema.name, definitions), enumerators };
}

class Comparison {
  constructor(file) {
    const text = readFileSync(file.replace(/\.mcap$/, ".jsonl"), "utf8");
    this.expected = text.trimEnd().split("\n").map(parseExpected);
    this.file = path.basename(file);
    this.decoders = new Map();
    this.next = 0;
  }

  message(channel, schema, message) {
    const expected = this.expected[this.next++];
    const where = `${this.file}: message ${this.next} on ${channel.topic}`;
    expect(expected !== undefined, `${where}: there should be no more`);
    expect(channel.messageEncoding === "cdr", `${where}: ${channel.messageEncoding}`);
    expect(channel.metadata.get("qos") === "reliability: reliable", `${where}: qos`);
    expect(channel.topic === expected.topic, `${where}: ${expected.topic}`);
    expect(message.sequence === expected.sequence, `${where}: sequence`);
    expect(String(message.logTime) === expected.log_time, `${where}: log time`);
    expect(String(message.publishTime) === expected.publish_time, `${where}: publish time`);
    if (!this.decoders.has(schema.name)) this.decoders.set(schema.name, decoder(schema));
    const { reader, enumerators } = this.decoders.get(schema.name);
    same(expected.message, reader.readMessage(message.data), enumerators, where);
  }

  done() {
    expect(this.next === this.expected.length, `${this.file}: ${this.next} of ${this.expected.length} messages`);
    return this.next;
  }
}

async function readByIndex(file) {
  const handle = await open(file);
  const readable = {
    size: async () => BigInt((await handle.stat()).size),
    read: async (offset, length) => {
      const buffer = new Uint8Array(Number(length));
      const { bytesRead } = await handle.read(buffer, 0, buffer.length, Number(offset));
      if (bytesRead !== buffer.length) throw new Error(`${file}: short read`);
      return buffer;
    },
  };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  expect(reader.header.profile === "", "the profile is not empty");
  const comparison = new Comparison(file);
  for await (const message of reader.readMessages()) {
    const channel = reader.channelsById.get(message.channelId);
    comparison.message(channel, reader.schemasById.get(channel.schemaId), message);
  }
  const count = comparison.done();
  expect(Number(reader.statistics.messageCount) === count, "statistics: messages");
  expect(reader.statistics.chunkCount === reader.chunkIndexes.length && reader.chunkIndexes.length > 3, "chunks");
  for await (const attachment of reader.readAttachments())
    expect(attachment.name === "cell.yaml" && new TextDecoder().decode(attachment.data) === "cell", "attachment");
  expect(reader.attachmentIndexes.length === 1, "one attachment");
  let ledger;
  for await (const metadata of reader.readMetadata()) if (metadata.name === "invar.loss_ledger") ledger = metadata;
  const entries = [...ledger.metadata].filter(([key]) => key !== "recovered").map(([, text]) => JSON.parse(text));
  expect(entries.reduce((sum, { written }) => sum + written, 0) === count, "the ledger's count");
  await handle.close();
  return count;
}

function readAsStream(file) {
  const reader = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  reader.append(readFileSync(file));
  const channels = new Map();
  const schemas = new Map();
  const comparison = new Comparison(file);
  for (let record; (record = reader.nextRecord()); ) {
    if (record.type === "Schema") schemas.set(record.id, record);
    if (record.type === "Channel") channels.set(record.id, record);
    if (record.type !== "Message") continue;
    const channel = channels.get(record.channelId);
    comparison.message(channel, schemas.get(channel.schemaId), record);
  }
  expect(reader.done(), `${file}: the stream does not end properly`);
  return comparison.done();
}

for (const name of ["plain", "lz4", "zstd"]) {
  const file = path.join(process.argv[2], `${name}.mcap`);
  console.log(`${name}: ${await readByIndex(file)} messages by index, ${readAsStream(file)} as stream`);
}
if (failures.length > 0) {
  console.error(failures.join("\n"));
  process.exit(1);
}
