// SPDX-License-Identifier: Apache-2.0
// node list.mjs FILE...: every message of recordings, whole or cut short, as @mcap/core reads them from start to end: a line
// "= FILE", then one a message: topic, sequence, log time, publish time, bytes, FNV-1a of them.
import { open } from "node:fs/promises";
import { McapStreamReader } from "@mcap/core";

function fnv1a(bytes) {
  let hash = 2166136261;
  for (const byte of bytes) hash = Math.imul(hash ^ byte, 16777619);
  return hash >>> 0;
}

async function list(path) {
  const reader = new McapStreamReader({ validateCrcs: true });
  const topics = new Map();
  const lines = [`= ${path}`];
  const file = await open(path, "r");
  const buffer = new Uint8Array(1 << 20);
  for (;;) {
    const { bytesRead } = await file.read(buffer, 0, buffer.length);
    if (bytesRead === 0) break;
    reader.append(buffer.slice(0, bytesRead));
    for (let record; (record = reader.nextRecord()); ) {
      if (record.type === "Channel") topics.set(record.id, record.topic);
      if (record.type !== "Message") continue;
      lines.push([topics.get(record.channelId), record.sequence, record.logTime, record.publishTime,
        record.data.byteLength, fnv1a(record.data)].join(" "));
    }
  }
  await file.close();
  console.log(lines.join("\n"));
}

for (const path of process.argv.slice(2)) await list(path);
