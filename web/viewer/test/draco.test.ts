// SPDX-License-Identifier: Apache-2.0
// Proves: the frozen frames of the format decode here to what they decode to in C++, and the others are refused.
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join } from 'node:path';
import { beforeAll, describe, expect, it } from 'vitest';
import { DracoDecoder, type Geometry } from '../src/draco';
import { parseFrame } from '../src/frame';
import { confidenceColours, decodeVertexQuality } from '../src/quality';

interface Expected {
  file: string;
  number: number;
  time_ns: string;
  vertices: number;
  triangles: number;
  texture: [number, number];
  has_normals: boolean;
  has_texture_coordinates: boolean;
  area_m2?: number;
  min?: number[];
  max?: number[];
  mean?: number[];
  mean_texture_coordinate?: number[];
  quality?: { known: number; interpolated: number; sum_sigma_m: number };
}

const folder = join(__dirname, '../../../tests/conformance/frame_v1');
const { frames, refused } = JSON.parse(readFileSync(join(folder, 'expected.json'), 'utf8')) as {
  frames: Expected[];
  refused: string[];
};
const load = (name: string): Uint8Array => new Uint8Array(readFileSync(join(folder, name)));

let decoder: DracoDecoder;
beforeAll(async () => {
  const wasm = readFileSync(createRequire(import.meta.url).resolve('draco3d/draco_decoder.wasm'));
  decoder = await DracoDecoder.create(new Uint8Array(wasm).buffer);
});

const column = (values: Float32Array, width: number, at: number): number[] =>
  Array.from({ length: values.length / width }, (_, i) => values[i * width + at]!);
const mean = (values: number[]): number => values.reduce((sum, x) => sum + x, 0) / values.length;

function area({ positions, triangles }: Geometry): number {
  let sum = 0;
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => positions.subarray(triangles[t + k]! * 3, triangles[t + k]! * 3 + 3)) as [
      Float32Array,
      Float32Array,
      Float32Array,
    ];
    const u = [0, 1, 2].map((i) => b[i]! - a[i]!) as [number, number, number];
    const v = [0, 1, 2].map((i) => c[i]! - a[i]!) as [number, number, number];
    sum += Math.hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]) / 2;
  }
  return sum;
}

describe('frozen frames', () => {
  it.each(frames)('$file is read as in C++', (expected) => {
    const frame = parseFrame(load(expected.file));
    const geometry = decoder.decode(frame);
    expect(frame.header.number).toBe(BigInt(expected.number));
    expect(frame.header.timeNs).toBe(BigInt(expected.time_ns));
    expect([frame.header.textureWidth, frame.header.textureHeight]).toEqual(expected.texture);
    expect(geometry.positions.length).toBe(expected.vertices * 3);
    expect(geometry.triangles.length).toBe(expected.triangles * 3);
    expect(geometry.normals !== null).toBe(expected.has_normals);
    expect(geometry.coordinates !== null).toBe(expected.has_texture_coordinates);
    if (expected.area_m2 !== undefined) expect(Math.abs(area(geometry) - expected.area_m2)).toBeLessThan(1e-4);
    for (let axis = 0; axis < 3 && expected.mean !== undefined; ++axis) {
      const values = column(geometry.positions, 3, axis);
      expect(Math.abs(Math.min(...values) - expected.min![axis]!)).toBeLessThan(1e-4);
      expect(Math.abs(Math.max(...values) - expected.max![axis]!)).toBeLessThan(1e-4);
      expect(Math.abs(mean(values) - expected.mean[axis]!)).toBeLessThan(1e-4);
    }
    expect(frame.quality.length > 0).toBe(expected.quality !== undefined);
    if (expected.quality !== undefined) {
      const { sigmas, interpolated } = decodeVertexQuality(frame.quality, geometry.coordinates!);
      expect(sigmas.length).toBe(expected.vertices);
      expect(Math.abs(sigmas.reduce((sum, s) => sum + s, 0) - expected.quality.sum_sigma_m)).toBeLessThan(1e-6);
      expect(sigmas.filter((s) => s > 0).length).toBe(expected.quality.known);
      expect(interpolated.filter((i) => i === 1).length).toBe(expected.quality.interpolated);
      expect(confidenceColours({ sigmas, interpolated }).every((c) => c >= 0 && c <= 1)).toBe(true);
    }
    expected.mean_texture_coordinate?.forEach((value, axis) => {
      expect(Math.abs(mean(column(geometry.coordinates!, 2, axis)) - value)).toBeLessThan(1e-4);
    });
  });

  it.each(refused)('%s is refused', (name) => {
    expect(() => decoder.decode(parseFrame(load(name)))).toThrow();
  });
});

describe('damaged frames', () => {
  it('give an error or a mesh, and the next frame decodes', () => {
    const whole = load('mesh.rlv');
    let random = 7;
    const next = (): number => (random = (Math.imul(random, 1664525) + 1013904223) >>> 0) >>> 8;
    let refusals = 0;
    for (let i = 0; i < 300; ++i) {
      const bytes = whole.slice();
      for (let k = 0; k < 3; ++k) bytes[64 + (next() % (bytes.length - 64))] = next() & 255;
      try {
        const geometry = decoder.decode(parseFrame(bytes));
        expect(geometry.triangles.every((index) => index < geometry.positions.length / 3)).toBe(true);
      } catch (error) {
        expect((error as Error).message).toMatch(/geometry|frame|memory/);
        ++refusals;
      }
    }
    expect(refusals).toBeGreaterThan(10);
    expect(decoder.decode(parseFrame(whole)).positions.length).toBe(167 * 3);
  });

  it('say nothing false of vertices', () => {
    const frame = parseFrame(load('with_quality.rlv'));
    const coordinates = decoder.decode(frame).coordinates!;
    for (let size = 0; size < frame.quality.length; ++size) {
      expect(() => decodeVertexQuality(frame.quality.subarray(0, size), coordinates)).toThrow();
    }
    expect(() => decodeVertexQuality(frame.quality, coordinates.subarray(2))).toThrow();
    for (let i = 0; i < 8 * frame.quality.length; ++i) {
      const bytes = frame.quality.slice();
      bytes[i >> 3]! ^= 1 << (i & 7);
      try {
        const { sigmas } = decodeVertexQuality(bytes, coordinates);
        expect(sigmas.every((s) => s >= 0 && s < 0.1)).toBe(true);
      } catch (error) {
        expect((error as Error).message).toMatch(/vertex quality/);
      }
    }
  });

  it('a stream of another kind does not reach the decoder', () => {
    const frame = parseFrame(load('mesh.rlv'));
    const bunny = readFileSync(createRequire(import.meta.url).resolve('draco3d/bunny.drc')); // sequential, 1.1
    expect(() => decoder.decode({ ...frame, geometry: new Uint8Array(bunny) })).toThrow(/not allowed/);
    expect(() => decoder.decode({ ...frame, geometry: new Uint8Array([1, 2, 3]) })).toThrow(/not a Draco stream/);
    expect(() => decoder.decode({ ...frame, geometry: frame.geometry.slice(0, 8) })).toThrow(/cut short/);
  });
});
