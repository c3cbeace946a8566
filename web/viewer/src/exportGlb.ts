// SPDX-License-Identifier: Apache-2.0
// A surface as a binary glTF 2.0 file, with its picture. Pure.
import type { Surface } from './pick';

const kAsset = { version: '2.0', generator: 'relievo' };
const kFloat = 5126;
const kUnsignedInt = 5125;

/** `jpeg`: the picture, or null. In glTF's axes: x right, y up, z backward. */
export function writeGlb(surface: Surface, jpeg: Uint8Array | null): Uint8Array<ArrayBuffer> {
  const vertices = surface.positions.length / 3;
  if (vertices === 0) return container({ asset: kAsset, scene: 0, scenes: [{}] }, [], 0); // no accessor may be of nothing
  const positions = surface.positions.map((c, i) => (i % 3 === 0 ? c : -c));
  const textured = jpeg !== null && surface.coordinates !== null;
  const colours = textured ? null : (surface.colours ?? null);
  const parts: Uint8Array[] = [];
  const bufferViews: object[] = [];
  let length = 0;
  const add = (bytes: ArrayBufferView, target?: number): number => {
    bufferViews.push({ buffer: 0, byteOffset: length, byteLength: bytes.byteLength, ...(target ? { target } : {}) });
    parts.push(new Uint8Array(bytes.buffer, bytes.byteOffset, bytes.byteLength), new Uint8Array(-bytes.byteLength & 3));
    length += bytes.byteLength + (-bytes.byteLength & 3);
    return bufferViews.length - 1;
  };
  const kVertices = 34962;
  const kIndices = 34963;
  const bounds = (pick: (a: number, b: number) => number): number[] => {
    const out = [...positions.subarray(0, 3)];
    for (let i = 3; i < positions.length; ++i) out[i % 3] = pick(out[i % 3]!, positions[i]!);
    return out;
  };
  const accessors: object[] = [
    { bufferView: add(positions, kVertices), componentType: kFloat, count: vertices, type: 'VEC3', min: bounds(Math.min), max: bounds(Math.max) },
  ];
  const attributes: Record<string, number> = { POSITION: 0 };
  if (textured) {
    attributes['TEXCOORD_0'] = accessors.length;
    accessors.push({ bufferView: add(surface.coordinates!, kVertices), componentType: kFloat, count: vertices, type: 'VEC2' });
  }
  if (colours !== null) {
    attributes['COLOR_0'] = accessors.length;
    accessors.push({ bufferView: add(colours, kVertices), componentType: kFloat, count: vertices, type: 'VEC3' });
  }
  const primitive: Record<string, unknown> = { attributes, material: 0, mode: surface.triangles.length > 0 ? 4 : 0 };
  if (surface.triangles.length > 0) {
    primitive['indices'] = accessors.length;
    accessors.push({ bufferView: add(surface.triangles, kIndices), componentType: kUnsignedInt, count: surface.triangles.length, type: 'SCALAR' });
  }
  const pbr = textured ? { baseColorTexture: { index: 0 } } : { baseColorFactor: colours === null ? [0.7, 0.7, 0.7, 1] : [1, 1, 1, 1] };
  const json = {
    asset: kAsset,
    extensionsUsed: ['KHR_materials_unlit'],
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives: [primitive] }],
    materials: [{ doubleSided: true, pbrMetallicRoughness: { ...pbr, metallicFactor: 0 }, extensions: { KHR_materials_unlit: {} } }],
    ...(textured ? { textures: [{ source: 0 }], images: [{ bufferView: add(jpeg), mimeType: 'image/jpeg' }] } : {}),
    accessors,
    bufferViews,
    buffers: [{ byteLength: length }],
  };
  return container(json, parts, length);
}

function container(content: object, parts: Uint8Array[], length: number): Uint8Array<ArrayBuffer> {
  const json = new TextEncoder().encode(JSON.stringify(content));
  const padded = json.length + (-json.length & 3);
  const out = new Uint8Array(12 + 8 + padded + (length === 0 ? 0 : 8 + length)).fill(0x20, 20, 20 + padded);
  const view = new DataView(out.buffer);
  const words = [0x46546c67, 2, out.length, padded, 0x4e4f534a];
  for (const [i, word] of words.entries()) view.setUint32(4 * i, word, true);
  out.set(json, 20);
  if (length === 0) return out;
  view.setUint32(20 + padded, length, true);
  view.setUint32(24 + padded, 0x004e4942, true);
  let at = 28 + padded;
  for (const part of parts) {
    out.set(part, at);
    at += part.length;
  }
  return out;
}
