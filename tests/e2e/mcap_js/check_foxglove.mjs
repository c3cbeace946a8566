// SPDX-License-Identifier: Apache-2.0
// node check_foxglove.mjs FILE DIR: the foxglove channels of a recording: their schemas say the same as the published ones, every
// message decodes, pictures are JPEGs, and models are GLBs, of which the last is written to DIR/last.glb. Prints the counts.
import { open, writeFile } from "node:fs/promises";
import { createRequire } from "node:module";
import { dirname, join } from "node:path";
import { McapStreamReader } from "@mcap/core";
import { parseIDL } from "@foxglove/omgidl-parser";
import { MessageReader } from "@foxglove/omgidl-serialization";

const require = createRequire(import.meta.url);
const internal = dirname(require.resolve("@foxglove/schemas/internal.js"));
const { foxgloveEnumSchemas, foxgloveMessageSchemas } = require("@foxglove/schemas/internal");
const { generateOmgIdl } = require(join(internal, "dist/internal/generateOmgIdl.js"));

function published() {
  const texts = [];
  for (const schema of [...Object.values(foxgloveEnumSchemas), ...Object.values(foxgloveMessageSchemas)])
    texts.push(generateOmgIdl(schema));
  const idl = texts.join("\n").replace(/^#include.*$/gm, "");
  return new Map(parseIDL(idl).map((definition) => [definition.name, definition]));
}

/// What decides how bytes are read.
function shape(definition) {
  const members = (definition.definitions ?? []).map((m) =>
    [m.name, m.type, m.isArray ?? false, m.isComplex ?? false, m.value ?? null].join(":"));
  return `${definition.aggregatedKind} ${members.join(" ")}`;
}

function checkSchema(text, theirs) {
  for (const definition of parseIDL(text)) {
    const other = theirs.get(definition.name);
    if (!other) throw new Error(`no ${definition.name} among the published schemas`);
    if (shape(definition) !== shape(other)) throw new Error(`${definition.name}: ${shape(definition)}, not ${shape(other)}`);
  }
}

function magic(bytes) {
  return String.fromCharCode(...bytes.subarray(0, 4));
}

function checkImage(message) {
  if (message.format !== "jpeg" || magic(message.data).slice(0, 3) !== "\xff\xd8\xff") throw new Error("no JPEG");
}

function checkScene(message) {
  const [entity] = message.entities;
  const [model] = entity.models;
  if (message.entities.length !== 1 || entity.models.length !== 1) throw new Error("not one model");
  if (model.media_type !== "model/gltf-binary" || magic(model.data) !== "glTF") throw new Error("no GLB");
  if (model.pose.orientation.w !== 1 || model.scale.x !== 1 || model.color.a !== 1) throw new Error("misplaced");
  return model.data;
}

const [, , path, folder] = process.argv;
const theirs = published();
const reader = new McapStreamReader({ validateCrcs: true });
const file = await open(path, "r");
reader.append(await file.readFile());
await file.close();
const schemas = new Map();
const channels = new Map();
const counts = { "foxglove::CompressedImage": 0, "foxglove::SceneUpdate": 0 };
let glb;
for (let record; (record = reader.nextRecord()); ) {
  if (record.type === "Schema") schemas.set(record.id, record);
  if (record.type === "Channel") {
    const schema = schemas.get(record.schemaId);
    if (!(schema.name in counts)) continue;
    const text = new TextDecoder().decode(schema.data);
    checkSchema(text, theirs);
    channels.set(record.id, { name: schema.name, reader: new MessageReader(schema.name, parseIDL(text)) });
  }
  const channel = record.type === "Message" ? channels.get(record.channelId) : undefined;
  if (!channel) continue;
  const message = channel.reader.readMessage(record.data);
  if (channel.name === "foxglove::CompressedImage") checkImage(message);
  else glb = checkScene(message);
  counts[channel.name] += 1;
}
if (glb) await writeFile(join(folder, "last.glb"), glb);
console.log(JSON.stringify(counts));
