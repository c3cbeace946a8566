// SPDX-License-Identifier: Apache-2.0
// node rewrite.mjs FILE FOLDER: the recording as @mcap/core writes it, once for each of the ways below, as FOLDER/NAME.mcap.
import { readFileSync, writeFileSync } from "node:fs";
import { McapStreamReader, McapWriter } from "@mcap/core";

const noIndex = { useMessageIndex: false, useChunkIndex: false, useAttachmentIndex: false };
const noRepeat = { repeatSchemas: false, repeatChannels: false };
const noStatistics = { useStatistics: false, useSummaryOffsets: false };
const ways = {
  plain: {},
  "one-chunk": { chunkSize: 1e9 },
  "a-chunk-a-message": { chunkSize: 1 },
  "no-message-index": { useMessageIndex: false },
  "no-index": noIndex,
  "no-statistics": noStatistics,
  "no-repeat": noRepeat,
  "no-summary": { ...noIndex, ...noRepeat, ...noStatistics },
  unchunked: { useChunks: false },
};

const [file, folder] = process.argv.slice(2);
const records = [];
const reader = new McapStreamReader();
reader.append(readFileSync(file));
for (let record; (record = reader.nextRecord()); ) records.push(record);

for (const [name, options] of Object.entries(ways)) {
  const parts = [];
  let size = 0;
  const writable = {
    position: () => BigInt(size),
    write: async (bytes) => {
      parts.push(Uint8Array.from(bytes));
      size += bytes.length;
    },
  };
  const writer = new McapWriter({ writable, ...options });
  await writer.start({ profile: "", library: "" });
  const schemas = new Map(), channels = new Map(); // their ids here, by those there
  for (const record of records) {
    if (record.type === "Schema" && !schemas.has(record.id)) schemas.set(record.id, await writer.registerSchema(record));
    if (record.type === "Channel" && !channels.has(record.id))
      channels.set(record.id, await writer.registerChannel({ ...record, schemaId: schemas.get(record.schemaId) }));
    if (record.type === "Attachment") await writer.addAttachment(record);
    if (record.type === "Message") await writer.addMessage({ ...record, channelId: channels.get(record.channelId) });
  }
  await writer.end();
  writeFileSync(`${folder}/${name}.mcap`, Buffer.concat(parts));
}
console.log(JSON.stringify(Object.keys(ways)));
