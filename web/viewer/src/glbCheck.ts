// SPDX-License-Identifier: Apache-2.0
// Whether a GLB file has what it announces and has it in itself: three's loader makes room for what a header says, and
// waits for ever for nodes that hold each other. Pure; any input.
import { FileError } from './fileError';
import { text } from './strings';

const kMagic = 0x46546c67; // "glTF"
const kHeadBytes = 12;
const kChunkHeadBytes = 8;
const kJson = 0x4e4f534a;
const kBin = 0x004e4942;

type Json = Record<string, unknown>;

/** Throws a FileError where it is none, damaged, cut short, of several files, or without a mesh. */
export function checkGlb(bytes: ArrayBuffer): void {
  const view = new DataView(bytes);
  if (bytes.byteLength < 4 || view.getUint32(0, true) !== kMagic) throw new FileError(text.file.noGlb);
  if (bytes.byteLength < kHeadBytes) throw new FileError(text.file.cutShort);
  if (view.getUint32(4, true) < 2) throw new FileError(text.file.oldGlb);
  const length = view.getUint32(8, true);
  if (length > bytes.byteLength) throw new FileError(text.file.cutShort);
  let json: Json | null = null;
  let binary = 0;
  for (let at = kHeadBytes; at < length; ) {
    if (at + kChunkHeadBytes > length) fail();
    const [size, type] = [view.getUint32(at, true), view.getUint32(at + 4, true)];
    at += kChunkHeadBytes;
    if (at + size > length) fail();
    if (type === kJson) json = parse(new Uint8Array(bytes, at, size));
    if (type === kBin) binary = size;
    at += size;
  }
  checkJson(json ?? fail(), binary);
}

function fail(): never {
  throw new FileError(text.file.damaged);
}

function parse(bytes: Uint8Array): Json {
  try {
    return objectOf(JSON.parse(new TextDecoder().decode(bytes)));
  } catch {
    return fail();
  }
}

const objectOf = (value: unknown): Json => (typeof value === 'object' && value !== null ? (value as Json) : fail());
const listOf = (value: unknown): unknown[] => (value === undefined ? [] : Array.isArray(value) ? value : fail());
const objectsOf = (value: unknown): Json[] => listOf(value).map(objectOf);
/** Of how many there are, or which one: 0 and up. */
const wholeOf = (value: unknown): number => (Number.isInteger(value) && (value as number) >= 0 ? (value as number) : fail());

/** `binary`: bytes of the file's own buffer. */
function checkJson(json: Json, binary: number): void {
  if (typeof objectOf(json['asset'])['version'] !== 'string') fail();
  const buffers = objectsOf(json['buffers']).map(({ uri, byteLength }) => {
    const isWithin = uri === undefined || (typeof uri === 'string' && uri.startsWith('data:'));
    if (!isWithin) throw new FileError(text.file.elsewhere);
    const room = typeof uri === 'string' ? uri.length : binary;
    return wholeOf(byteLength) <= room ? wholeOf(byteLength) : fail();
  });
  for (const { buffer, byteOffset = 0, byteLength } of objectsOf(json['bufferViews'])) {
    if (!(wholeOf(byteOffset) + wholeOf(byteLength) <= (buffers[wholeOf(buffer)] ?? -1))) fail();
  }
  const meshes = objectsOf(json['meshes']);
  if (meshes.length === 0) throw new FileError(text.file.noSurface);
  checkAccessors(json, meshes, binary);
  checkTree(json);
}

/** An accessor without bytes is all zeros, however many it says, but for those that say what Draco decodes to. */
function checkAccessors(json: Json, meshes: Json[], binary: number): void {
  const decoded = new Set<unknown>();
  for (const { extensions, attributes, indices } of meshes.flatMap(({ primitives }) => objectsOf(primitives))) {
    if (extensions === undefined || !('KHR_draco_mesh_compression' in objectOf(extensions))) continue;
    for (const accessor of [indices, ...Object.values(objectOf(attributes))]) decoded.add(accessor);
  }
  for (const [i, { bufferView, count }] of objectsOf(json['accessors']).entries()) {
    if (wholeOf(count) > binary && bufferView === undefined && !decoded.has(i)) fail();
  }
}

/** Each node has one parent at most, and what a scene begins with has none: then no node is within itself. */
function checkTree(json: Json): void {
  const nodes = objectsOf(json['nodes']);
  const children = new Set<number>();
  for (const child of nodes.flatMap((node) => listOf(node['children'])).map(wholeOf)) {
    if (children.has(child) || child >= nodes.length) fail();
    children.add(child);
  }
  for (const root of objectsOf(json['scenes']).flatMap((scene) => listOf(scene['nodes']))) {
    if (children.has(wholeOf(root))) fail();
  }
}
