// SPDX-License-Identifier: Apache-2.0
// node check_foxglove.mjs FILE DIR: the foxglove channels of a recording: their schemas say the same as the published ones, every
// message decodes, pictures are JPEGs, and models are GLBs, of which the last is written to DIR/last.glb. Prints the counts, and `off_px`:
// how far the last picture, by its calibration, lies from where the vertices of the last surface have it, as Foxglove places both.
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

/// Width and height, from the start of the frame.
function jpegSize(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  for (let at = 2; at + 9 < bytes.length; at += 2 + view.getUint16(at + 2))
    if (bytes[at + 1] >= 0xc0 && bytes[at + 1] <= 0xc2) return [view.getUint16(at + 7), view.getUint16(at + 5)];
  throw new Error("no size in the JPEG");
}

function checkImage(message) {
  if (message.format !== "jpeg" || magic(message.data).slice(0, 3) !== "\xff\xd8\xff") throw new Error("no JPEG");
}

/// Comes before the image that it is of, and says the same time and coordinate frame.
function checkPair(calibration, image) {
  if (calibration.frame_id !== image.frame_id) throw new Error(`calibration of ${calibration.frame_id}, not ${image.frame_id}`);
  if (JSON.stringify(calibration.timestamp) !== JSON.stringify(image.timestamp)) throw new Error("of another time");
  if (`${[calibration.width, calibration.height]}` !== `${jpegSize(image.data)}`) throw new Error("of another size");
  if (calibration.distortion_model !== "plumb_bob" || calibration.D.length !== 5) throw new Error("no plumb_bob");
  const [fx, , cx, , fy, cy] = calibration.K;
  const [px, , pcx, , , py, pcy] = calibration.P;
  if (!(fx > 0) || `${[fx, cx, fy, cy]}` !== `${[px, pcx, py, pcy]}`) throw new Error("P is not K");
  if (`${[...calibration.R]}` !== "1,0,0,0,1,0,0,0,1") throw new Error("R turns");
}

function checkScene(message) {
  const [entity] = message.entities;
  const [model] = entity.models;
  if (message.entities.length !== 1 || entity.models.length !== 1) throw new Error("not one model");
  if (model.media_type !== "model/gltf-binary" || magic(model.data) !== "glTF") throw new Error("no GLB");
  if (model.pose.orientation.w !== 1 || model.scale.x !== 1 || model.color.a !== 1) throw new Error("misplaced");
  return model.data;
}

/// Positions and texture coordinates of a GLB of one surface.
function vertices(glb) {
  const view = new DataView(glb.buffer, glb.byteOffset, glb.byteLength);
  const jsonBytes = view.getUint32(12, true);
  const json = JSON.parse(new TextDecoder().decode(glb.subarray(20, 20 + jsonBytes)));
  const read = (name, each) => {
    const { bufferView, count, byteOffset = 0 } = json.accessors[json.meshes[0].primitives[0].attributes[name]];
    const start = 28 + jsonBytes + (json.bufferViews[bufferView].byteOffset ?? 0) + byteOffset;
    return Array.from({ length: count }, (_, i) =>
      Array.from({ length: each }, (_, k) => view.getFloat32(start + 4 * (each * i + k), true)));
  };
  return { positions: read("POSITION", 3), coordinates: read("TEXCOORD_0", 2) };
}

/// Vector turned the other way round than the unit quaternion says.
function unturn({ x, y, z, w }, v) {
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const t = cross([-x, -y, -z], v).map((c) => 2 * c);
  return v.map((c, i) => c + w * t[i] + cross([-x, -y, -z], t)[i]);
}

/// The mean over all vertices, in pixels.
function offPixels(glb, transform, scene, calibration) {
  const [entity] = scene.entities;
  if (transform.parent_frame_id !== entity.frame_id || transform.child_frame_id !== calibration.frame_id)
    throw new Error("nothing relates the image's coordinate frame to the surface's");
  const { positions, coordinates } = vertices(glb);
  const [k1, k2, p1, p2, k3] = calibration.D;
  const [fx, skew, cx, , fy, cy] = calibration.K;
  const { x: dx, y: dy, z: dz } = transform.translation;
  let sum = 0;
  positions.forEach(([px, py, pz], i) => {
    // Foxglove stands a GLB up: y, its up, becomes z.
    const [X, Y, Z] = unturn(transform.rotation, [px - dx, -pz - dy, py - dz]);
    const x = X / Z, y = Y / Z, r2 = x * x + y * y, radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
    const xd = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x);
    const yd = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
    const column = coordinates[i][0] * calibration.width - 0.5, row = coordinates[i][1] * calibration.height - 0.5;
    sum += Z > 0 ? Math.hypot(fx * xd + skew * yd + cx - column, fy * yd + cy - row) : Infinity;
  });
  return sum / positions.length;
}

const [, , path, folder] = process.argv;
const theirs = published();
const reader = new McapStreamReader({ validateCrcs: true });
const file = await open(path, "r");
reader.append(await file.readFile());
await file.close();
const schemas = new Map();
const channels = new Map();
const counts = {
  "foxglove::CompressedImage": 0, "foxglove::CameraCalibration": 0, "foxglove::FrameTransform": 0, "foxglove::SceneUpdate": 0,
};
const last = {};
let glb;
for (let record; (record = reader.nextRecord()); ) {
  if (record.type === "Schema") schemas.set(record.id, record);
  if (record.type === "Channel") {
    const schema = schemas.get(record.schemaId);
    if (!(schema.name in counts)) continue;
    // Foxglove looks for an image's calibration among topics of the same beginning.
    if (!record.topic.startsWith("relievo/")) throw new Error(`${record.topic}: not beside the others`);
    const text = new TextDecoder().decode(schema.data);
    checkSchema(text, theirs);
    channels.set(record.id, { name: schema.name, reader: new MessageReader(schema.name, parseIDL(text)) });
  }
  const channel = record.type === "Message" ? channels.get(record.channelId) : undefined;
  if (!channel) continue;
  const message = channel.reader.readMessage(record.data);
  if (channel.name === "foxglove::CompressedImage") checkImage(message);
  if (channel.name === "foxglove::CompressedImage" && last["foxglove::CameraCalibration"])
    checkPair(last["foxglove::CameraCalibration"], message);
  if (channel.name === "foxglove::SceneUpdate") glb = checkScene(message);
  last[channel.name] = message;
  counts[channel.name] += 1;
}
if (glb) await writeFile(join(folder, "last.glb"), glb);
const calibration = last["foxglove::CameraCalibration"];
const off_px = calibration ? offPixels(glb, last["foxglove::FrameTransform"], last["foxglove::SceneUpdate"], calibration) : null;
console.log(JSON.stringify({ ...counts, off_px }));
