// SPDX-License-Identifier: Apache-2.0
// Geometry codec 1 of codec/FORMAT.md, and the lists of numbers of codec 3, with Google's decoder compiled to WebAssembly.
// Runs in the worker.
import createDecoder from 'draco3d/draco_decoder_nodejs.js';
import { kGeometryDraco, kLimits, type Frame } from './frame';
import type { Attribute, DataType, Decoder, DecoderModule, Mesh, PointCloud } from 'draco3d';

export interface Geometry {
  positions: Float32Array<ArrayBuffer>; // xyz a vertex
  coordinates: Float32Array<ArrayBuffer> | null; // uv a vertex
  normals: Float32Array<ArrayBuffer> | null;
  triangles: Uint32Array<ArrayBuffer>; // empty: a point cloud
}

/** The part of the module that its published types lack. */
interface DecoderWithArrays extends Decoder {
  DecodeArrayToMesh(data: Uint8Array, size: number, mesh: Mesh): { ok(): boolean; error_msg(): string };
  DecodeArrayToPointCloud(data: Uint8Array, size: number, cloud: PointCloud): { ok(): boolean; error_msg(): string };
}

interface AttributeWithType extends Attribute {
  data_type(): DataType;
}

export class DracoDecoder {
  private scratch = 0;
  private scratchBytes = 0;

  private constructor(private readonly module: DecoderModule) {}

  static async create(wasmBinary: ArrayBuffer): Promise<DracoDecoder> {
    return new DracoDecoder(await createDecoder({ wasmBinary }));
  }

  /** Throws where the geometry is not what the frame's header declares. Any input. */
  decode(frame: Frame): Geometry {
    if (frame.geometryCodec !== kGeometryDraco) {
      throw new Error(`geometry codec ${frame.geometryCodec} is not known here`);
    }
    const { vertices, triangles } = frame.header;
    const bytes = frame.geometry;
    if (vertices === 0) {
      return {
        positions: new Float32Array(0),
        coordinates: null,
        normals: null,
        triangles: new Uint32Array(0),
      };
    }
    const declared = declaredCounts(bytes);
    if (declared.vertices !== vertices || declared.triangles !== triangles) {
      throw new Error('geometry is not of the size that the frame declares');
    }
    return this.read(bytes, vertices, triangles);
  }

  /** Of another file than a frame's: as large as it says itself, within the limits of frames. Throws otherwise. Any input. */
  mesh(bytes: Uint8Array): Geometry {
    const { vertices, triangles } = declaredCounts(bytes);
    if (vertices > kLimits.vertices || triangles > kLimits.triangles) throw new Error('geometry is too large');
    return this.read(bytes, vertices, triangles);
  }

  private read(bytes: Uint8Array, vertices: number, triangles: number): Geometry {
    const m = this.module;
    const decoder = new m.Decoder() as DecoderWithArrays;
    const mesh = triangles > 0 ? new m.Mesh() : (new m.PointCloud() as Mesh);
    try {
      const status =
        triangles > 0
          ? decoder.DecodeArrayToMesh(bytes, bytes.length, mesh)
          : decoder.DecodeArrayToPointCloud(bytes, bytes.length, mesh);
      if (!status.ok()) throw new Error(`geometry cannot be decoded: ${status.error_msg()}`);
      if (mesh.num_points() !== vertices || (triangles > 0 && mesh.num_faces() !== triangles)) {
        throw new Error('geometry decoded to another size than was declared');
      }
      const positions = this.attribute(decoder, mesh, m.POSITION, 3);
      if (positions === null) throw new Error('geometry has no positions');
      return {
        positions,
        coordinates: this.attribute(decoder, mesh, m.TEX_COORD, 2),
        normals: this.attribute(decoder, mesh, m.NORMAL, 3),
        triangles: triangles > 0 ? this.faces(decoder, mesh, triangles, vertices) : new Uint32Array(0),
      };
    } finally {
      m.destroy(mesh);
      m.destroy(decoder);
    }
  }

  /**
   * Lists of whole numbers, all of a length: a point cloud with a generic attribute of one component for each. Throws where
   * it is anything else. Any input.
   */
  numbers(bytes: Uint8Array, length: { exactly: number } | { atMost: number }, lists: number): Int32Array[] {
    const declared = declaredCounts(bytes);
    const count = declared.vertices;
    const fits = 'exactly' in length ? count === length.exactly : count <= length.atMost;
    if (declared.triangles > 0 || count === 0 || !fits) throw new Error('geometry has a list of a wrong length');
    const m = this.module;
    const decoder = new m.Decoder() as DecoderWithArrays;
    const cloud = new m.PointCloud();
    try {
      const status = decoder.DecodeArrayToPointCloud(bytes, bytes.length, cloud);
      if (!status.ok()) throw new Error(`geometry cannot be decoded: ${status.error_msg()}`);
      if (cloud.num_points() !== count || cloud.num_attributes() !== lists) {
        throw new Error('geometry does not hold the lists that the format asks for');
      }
      return Array.from({ length: lists }, (_, i) => {
        const attribute = decoder.GetAttribute(cloud, i) as AttributeWithType;
        if (attribute.num_components() !== 1 || attribute.data_type() !== m.DT_INT32) {
          throw new Error('geometry has an attribute of a wrong shape');
        }
        const at = this.reserve(count * 4);
        decoder.GetAttributeDataArrayForAllPoints(cloud, attribute, m.DT_INT32, count * 4, at);
        return new Int32Array(m.HEAPF32.buffer, at, count).slice();
      });
    } finally {
      m.destroy(cloud);
      m.destroy(decoder);
    }
  }

  private attribute(
    decoder: Decoder,
    mesh: Mesh,
    type: DecoderModule['POSITION'],
    components: number,
  ): Float32Array<ArrayBuffer> | null {
    const id = decoder.GetAttributeId(mesh, type as unknown as number);
    if (id < 0) return null;
    const attribute: Attribute = decoder.GetAttribute(mesh, id);
    if (attribute.num_components() !== components) throw new Error('geometry has an attribute of a wrong shape');
    const count = mesh.num_points() * components;
    const at = this.reserve(count * 4);
    decoder.GetAttributeDataArrayForAllPoints(mesh, attribute, this.module.DT_FLOAT32, count * 4, at);
    return new Float32Array(this.module.HEAPF32.buffer, at, count).slice() as Float32Array<ArrayBuffer>;
  }

  private faces(decoder: Decoder, mesh: Mesh, triangles: number, vertices: number): Uint32Array<ArrayBuffer> {
    const at = this.reserve(triangles * 12);
    decoder.GetTrianglesUInt32Array(mesh, triangles * 12, at);
    const indices = new Uint32Array(this.module.HEAPF32.buffer, at, triangles * 3).slice();
    for (const index of indices) {
      if (index >= vertices) throw new Error('geometry has a triangle on a vertex that is not there');
    }
    return indices as Uint32Array<ArrayBuffer>;
  }

  // The decoder's heap keeps one block that only grows, instead of one a frame.
  private reserve(bytes: number): number {
    if (bytes > this.scratchBytes) {
      if (this.scratch !== 0) this.module._free(this.scratch);
      this.scratchBytes = Math.ceil(bytes * 1.25);
      this.scratch = this.module._malloc(this.scratchBytes);
      if (this.scratch === 0) {
        this.scratchBytes = 0;
        throw new Error('no memory left to decode the geometry');
      }
    }
    return this.scratch;
  }
}

/** Only the two kinds of stream the format allows reach the decoder, and only with the sizes declared. */
function declaredCounts(bytes: Uint8Array): { vertices: number; triangles: number } {
  let at = 0;
  const byte = (): number => {
    const value = bytes[at++];
    if (value === undefined) throw new Error('geometry is cut short');
    return value;
  };
  const varint = (): number => {
    let value = 0;
    for (let scale = 1; scale <= 2 ** 28; scale *= 128) {
      const b = byte();
      value += (b & 0x7f) * scale;
      if (b < 0x80) break;
    }
    return value;
  };
  for (const letter of 'DRACO') {
    if (byte() !== letter.charCodeAt(0)) throw new Error('geometry is not a Draco stream');
  }
  const [major, minor, type, method] = [byte(), byte(), byte(), byte()];
  const flags = byte() + byte();
  const isMesh = major === 2 && minor === 2 && type === 1 && method === 1;
  const isCloud = major === 2 && minor === 3 && type === 0 && method === 0;
  if ((!isMesh && !isCloud) || flags !== 0) throw new Error('geometry is a Draco stream of a kind not allowed');
  if (isCloud) {
    const vertices = byte() + byte() * 2 ** 8 + byte() * 2 ** 16 + byte() * 2 ** 24;
    return { vertices, triangles: 0 };
  }
  const predictive = byte() === 1;
  const counts = { vertices: varint(), triangles: varint() };
  if (predictive || byte() !== 0) throw new Error('geometry is a Draco mesh of a kind not allowed');
  return counts;
}
