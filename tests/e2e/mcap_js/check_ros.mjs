// SPDX-License-Identifier: Apache-2.0
// node check_ros.mjs FILE: a bag for ROS 2, read as its readers do: by the definitions in the file, which must say the same as
// ROS's own. Prints what is in it, with each topic's first message; of points the fields of the first one.
// node check_ros.mjs TYPE FILE: one message as it came from the network, by ROS's own definition.
import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";
import { McapStreamReader } from "@mcap/core";

const require = createRequire(import.meta.url);
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");
const { ros2jazzy: published } = require("@foxglove/rosmsg-msgs-common");

/// What decides how bytes are read and what they are called.
function members(definition) {
  return definition.definitions
    .filter((m) => !m.isConstant)
    .map((m) => [m.name, m.type.replace("/msg/", "/"), m.isArray ?? false, m.arrayLength ?? 0].join(":"))
    .join(" ");
}

function checkDefinitions(definitions, type) {
  for (const definition of definitions) {
    const name = (definition.name ?? type).replace("/msg/", "/");
    const [folder, message] = name.split("/");
    const theirs = published[`${folder}/msg/${message}`] ?? published[name];
    if (!theirs) throw new Error(`ROS has no ${name}`);
    if (members(definition) !== members(theirs)) throw new Error(`${name}: ${members(definition)}, not ${members(theirs)}`);
  }
}

const kSizes = { 2: ["getUint8", 1], 7: ["getFloat32", 4] };  // of sensor_msgs/PointField's data types

function firstPoint(message) {
  if (message.data.length !== message.height * message.row_step || message.row_step !== message.width * message.point_step)
    throw new Error("points are of another size");
  const view = new DataView(message.data.buffer, message.data.byteOffset, message.data.length);
  return Object.fromEntries(message.fields.map((field) => {
    if (field.name === "rgb") {
      const [blue, green, red] = message.data.subarray(field.offset, field.offset + 3);
      return [field.name, [red, green, blue]];
    }
    const [get] = kSizes[field.datatype];
    return [field.name, view[get](field.offset, !message.is_bigendian)];
  }));
}

function described(type, message) {
  const bytes = (value) => (ArrayBuffer.isView(value) ? Array.from(value.subarray(0, 16)) : value);
  const out = Object.fromEntries(Object.entries(message).map(([name, value]) => [name, bytes(value)]));
  if (type === "sensor_msgs/msg/PointCloud2") return { ...out, data: firstPoint(message) };
  return out;
}

function checkMessage(type, bytes) {
  const own = published[type.replace("/msg/", "/")];
  const others = Object.values(published).filter((definition) => definition !== own);
  const reader = new MessageReader([{ ...own, name: undefined }, ...others]);
  process.stdout.write(JSON.stringify(described(type, reader.readMessage(bytes))));
}

const [, , path, message] = process.argv;
if (message) {
  checkMessage(path, await readFile(message));
  process.exit();
}
const reader = new McapStreamReader({ validateCrcs: true });
reader.append(await readFile(path));
const schemas = new Map();
const channels = new Map();
const result = { profile: "", topics: {} };
for (let record; (record = reader.nextRecord()); ) {
  if (record.type === "Header") result.profile = record.profile;
  if (record.type === "Schema") schemas.set(record.id, record);
  if (record.type === "Channel" && !channels.has(record.id)) {
    const schema = schemas.get(record.schemaId);
    if (schema.encoding !== "ros2msg" || record.messageEncoding !== "cdr") throw new Error(`${record.topic} is not of ROS 2`);
    const definitions = parse(new TextDecoder().decode(schema.data), { ros2: true });
    checkDefinitions(definitions, schema.name);
    channels.set(record.id, { topic: record.topic, type: schema.name, reader: new MessageReader(definitions) });
    result.topics[record.topic] = { type: schema.name, count: 0, times: [] };
  }
  if (record.type !== "Message") continue;
  const channel = channels.get(record.channelId);
  const message = channel.reader.readMessage(record.data);
  const topic = result.topics[channel.topic];
  topic.first ??= described(channel.type, message);
  topic.count += 1;
  topic.times.push(record.logTime.toString());
}
if (!reader.done()) throw new Error("the file is cut short");
process.stdout.write(JSON.stringify(result));
