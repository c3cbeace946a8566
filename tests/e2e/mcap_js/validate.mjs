// SPDX-License-Identifier: Apache-2.0
// node validate.mjs FILE: opens a recording with @mcap/core, through its index and from start to end, checks every
// CRC, and decodes every message with its own OMG IDL schema. Prints JSON; exits 1, with one line, on any failure.
import { open } from "node:fs/promises";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import { parseIDL } from "@foxglove/omgidl-parser";
import { MessageReader } from "@foxglove/omgidl-serialization";

class FileReadable {
  constructor(handle, size) {
    this.handle = handle;
    this.bytes = size;
  }
  async size() {
    return BigInt(this.bytes);
  }
  async read(offset, length) {
    const buffer = new Uint8Array(Number(length));
    const { bytesRead } = await this.handle.read(buffer, 0, buffer.length, Number(offset));
    if (bytesRead !== buffer.length) throw new Error(`${bytesRead} of ${length} bytes at ${offset}`);
    return buffer;
  }
}

function makeDecoder(channel, schema) {
  if (channel.messageEncoding !== "cdr") throw new Error(`${channel.topic}: message encoding ${channel.messageEncoding}`);
  if (schema?.encoding !== "omgidl") throw new Error(`${channel.topic}: schema encoding ${schema?.encoding}`);
  const reader = new MessageReader(schema.name, parseIDL(new TextDecoder().decode(schema.data)));
  return (data) => reader.readMessage(data);
}

/// A message as JSON can hold it: byte sequences by their length, 64-bit numbers as text.
function brief(value) {
  if (typeof value === "bigint") return value.toString();
  if (ArrayBuffer.isView(value)) return { bytes: value.byteLength };
  if (Array.isArray(value)) return value.length > 16 ? { length: value.length } : value.map(brief);
  if (value !== null && typeof value === "object")
    return Object.fromEntries(Object.entries(value).map(([key, inner]) => [key, brief(inner)]));
  return value;
}

async function readIndexed(handle, size) {
  const reader = await McapIndexedReader.Initialize({ readable: new FileReadable(handle, size) });
  const topics = new Map();
  const decoders = new Map();
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    const channel = reader.channelsById.get(message.channelId);
    if (!decoders.has(channel.id)) decoders.set(channel.id, makeDecoder(channel, reader.schemasById.get(channel.schemaId)));
    const decoded = brief(decoders.get(channel.id)(message.data));
    const record = { logTime: message.logTime.toString(), sequence: message.sequence, message: decoded };
    const known = topics.get(channel.id);
    if (known) Object.assign(known, { count: known.count + 1, last: record });
    else topics.set(channel.id, { topic: channel.topic, schema: reader.schemasById.get(channel.schemaId).name, count: 1, first: record, last: record });
  }
  for (const [id, { topic, count }] of topics) {
    const said = Number(reader.statistics?.channelMessageCounts.get(id) ?? -1);
    if (said !== count) throw new Error(`${topic}: ${count} messages, but the statistics say ${said}`);
  }
  const attachments = [];
  for await (const attachment of reader.readAttachments({ validateCrcs: true }))
    attachments.push({ name: attachment.name, mediaType: attachment.mediaType, bytes: attachment.data.byteLength });
  return { topics: [...topics.values()], attachments };
}

/// The whole file in order: the CRCs of chunks, attachments and the data section.
async function countStreamed(handle, size) {
  const reader = new McapStreamReader({ validateCrcs: true });
  const buffer = new Uint8Array(1 << 20);
  let messages = 0;
  let records = 0;
  for (let at = 0; at < size; ) {
    const { bytesRead } = await handle.read(buffer, 0, buffer.length, at);
    if (bytesRead === 0) throw new Error(`nothing to read at ${at}`);
    reader.append(buffer.slice(0, bytesRead));
    at += bytesRead;
    for (let record; (record = reader.nextRecord()); ) {
      ++records;
      if (record.type === "Message") ++messages;
    }
  }
  if (!reader.done()) throw new Error("the file does not end as an MCAP file does");
  return { messages, records };
}

try {
  if (process.argv.length !== 3) throw new Error("usage: node validate.mjs FILE");
  const handle = await open(process.argv[2], "r");
  const { size } = await handle.stat();
  const indexed = await readIndexed(handle, size);
  const streamed = await countStreamed(handle, size);
  await handle.close();
  const messages = indexed.topics.reduce((sum, topic) => sum + topic.count, 0);
  if (messages !== streamed.messages)
    throw new Error(`${messages} messages through the index, ${streamed.messages} from start to end`);
  console.log(JSON.stringify({ messages, ...indexed }, null, 2));
} catch (error) {
  console.error(`validate: ${error.message}`);
  process.exit(1);
}
