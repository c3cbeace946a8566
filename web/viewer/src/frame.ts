// SPDX-License-Identifier: Apache-2.0
// One frame of 3D video as bytes: codec/FORMAT.md. Checks everything it says before anything is decoded.
import { videoTextureIsKey } from './videoTexture';

export interface FrameHeader {
  version: number;
  number: bigint;
  timeNs: bigint;
  volumeMin: [number, number, number];
  volumeSize: number;
  vertices: number;
  triangles: number;
  textureWidth: number;
  textureHeight: number;
}

export interface Frame {
  header: FrameHeader;
  isKey: boolean; // decodes without any frame before it
  geometryCodec: number;
  geometry: Uint8Array; // views into the bytes given
  textureCodec: number; // 0: none
  texture: Uint8Array;
  quality: Uint8Array; // empty: nothing is said of each vertex
}

export const kGeometryDraco = 1;
export const kGeometryGrid = 2;
export const kGeometryDracoGrid = 3;
export const kTextureJpeg = 1;
export const kTextureWebp = 2;
export const kTexturePng = 3;
export const kTextureH264 = 4;
const kQualityCodec = 1;

const kFixedBytes = 64;
const kEntryBytes = 8;
const kMaxSections = 16;
export const kLimits = { vertices: 4_000_000, triangles: 8_000_000, pixels: 64_000_000 };

/** Throws an Error that says what is wrong; any input. */
export function parseFrame(bytes: Uint8Array): Frame {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const isFrame =
    bytes.length >= 4 && bytes[0] === 0x52 && bytes[1] === 0x4c && bytes[2] === 0x56 && bytes[3] === 0x46;
  if (!isFrame) throw new Error('not a Relievo frame: it does not start with RLVF');
  if (bytes.length < kFixedBytes) throw new Error(`frame is cut short: ${bytes.length} bytes`);
  const version = view.getUint8(4);
  if (version !== 1) throw new Error(`frame is of format version ${version}, this viewer knows version 1`);
  const flags = view.getUint8(5);
  if (flags > 1) throw new Error(`frame has flags that this viewer does not know (${flags})`);
  const headerBytes = view.getUint16(6, true);
  if (headerBytes > bytes.length) throw new Error(`frame is cut short: ${bytes.length} bytes`);
  const header: FrameHeader = {
    version,
    number: view.getBigUint64(8, true),
    timeNs: view.getBigInt64(16, true),
    volumeMin: [view.getFloat32(24, true), view.getFloat32(28, true), view.getFloat32(32, true)],
    volumeSize: view.getFloat32(36, true),
    vertices: view.getUint32(40, true),
    triangles: view.getUint32(44, true),
    textureWidth: view.getUint32(48, true),
    textureHeight: view.getUint32(52, true),
  };
  const volumeOk = [...header.volumeMin, header.volumeSize].every(Number.isFinite) && header.volumeSize >= 0;
  if (!volumeOk) throw new Error('frame has a volume that is not finite');
  const sections = readSections(bytes, view, headerBytes);
  const textureIsKey = sections.textureCodec !== kTextureH264 || videoTextureIsKey(sections.texture);
  if (flags === 0 ? sections.geometryCodec !== kGeometryGrid && textureIsKey : !textureIsKey) {
    throw new Error('frame and its sections do not agree whether this is a key frame');
  }
  checkCounts(header, sections);
  return { header, isKey: flags === 1, ...sections };
}

function readSections(bytes: Uint8Array, view: DataView, headerBytes: number): Omit<Frame, 'header' | 'isKey'> {
  const count = view.getUint8(56);
  const entryBytes = view.getUint8(57);
  const tableAt = view.getUint16(58, true);
  const broken =
    count > kMaxSections ||
    entryBytes < kEntryBytes ||
    tableAt < kFixedBytes ||
    tableAt + count * entryBytes > headerBytes;
  if (broken) throw new Error('frame has a broken table of sections');
  const nothing = bytes.subarray(0, 0);
  let geometry: Uint8Array | null = null;
  let texture: Uint8Array | null = null;
  let quality: Uint8Array | null = null;
  let geometryCodec = 0;
  let textureCodec = 0;
  let at = headerBytes;
  for (let i = 0; i < count; ++i) {
    const entry = tableAt + i * entryBytes;
    const kind = view.getUint8(entry);
    const codec = view.getUint8(entry + 1);
    const required = (view.getUint16(entry + 2, true) & 1) !== 0;
    const size = view.getUint32(entry + 4, true);
    if (size > bytes.length - at) throw new Error('frame is cut short: a section ends behind its end');
    const section = bytes.subarray(at, at + size);
    at += size;
    if (kind === 1 && geometry === null) {
      geometry = section;
      geometryCodec = codec;
    } else if (kind === 2 && texture === null) {
      texture = section;
      textureCodec = codec;
      if (codec === 0) throw new Error('frame has a texture section without a codec');
    } else if (kind === 4 && quality === null) {
      quality = codec === kQualityCodec ? section : nothing; // of a later version: the surface does without
    } else if (kind === 1 || kind === 2 || kind === 4) {
      throw new Error(`frame has two sections of kind ${kind}`);
    } else if (required) {
      throw new Error(`frame needs a section of kind ${kind} that this viewer does not know`);
    }
  }
  if (at !== bytes.length) throw new Error(`frame has ${bytes.length - at} bytes behind its end`);
  if (geometry === null) throw new Error('frame has no geometry section');
  return { geometry, geometryCodec, texture: texture ?? nothing, textureCodec, quality: quality ?? nothing };
}

/** FORMAT.md, "Sizes": what a frame may ask for is bounded by the bytes it brings. */
function checkCounts(header: FrameHeader, sections: Omit<Frame, 'header' | 'isKey'>): void {
  const { vertices, triangles } = header;
  const geometryCodec = sections.geometryCodec;
  const geometryBytes = sections.geometry.length;
  const textureBytes = sections.texture.length;
  const pixels = header.textureWidth * header.textureHeight;
  if (vertices > kLimits.vertices) throw new Error(`frame has ${vertices} vertices, more than the limit`);
  if (triangles > kLimits.triangles) throw new Error(`frame has ${triangles} triangles, more than the limit`);
  if (pixels > kLimits.pixels) throw new Error(`frame has ${pixels} texture pixels, more than the limit`);
  const items = triangles > 0 ? triangles : vertices;
  const isGrid = geometryCodec === kGeometryGrid || geometryCodec === kGeometryDracoGrid;
  const tooMany = isGrid
    ? triangles > 2 * vertices || vertices > 256 * geometryBytes
    : vertices > 3 * items || items > 8 * geometryBytes;
  if ((vertices === 0) !== (geometryBytes === 0) || tooMany) {
    throw new Error(`frame declares ${vertices} vertices and ${triangles} triangles in ${geometryBytes} bytes`);
  }
  if ((pixels === 0) !== (textureBytes === 0) || pixels > (sections.textureCodec === kTextureH264 ? 16_384 : 256) * textureBytes) {
    throw new Error(
      `frame declares a texture of ${header.textureWidth}x${header.textureHeight} in ${textureBytes} bytes`,
    );
  }
}
