// SPDX-License-Identifier: Apache-2.0
// Proves: the frozen grids decode here to what they decode to in C++, exactly where numbers are whole; others are refused.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { describe, expect, it } from 'vitest';
import { parseFrame } from '../src/frame';
import { GridFrames } from '../src/grid';
import { decodeGrid, kAbsent, kMargin, type Grid, type KeyGrid } from '../src/gridDecoder';
import { gridId } from '../src/gridHead';
import type { GridSurface } from '../src/gridPoints';

interface Expected {
  file: string;
  key: boolean;
  number: number;
  vertices: number;
  triangles: number;
  triangle_hash: number;
  place_hash: number;
  area_m2: number;
  min: number[];
  max: number[];
  mean: number[];
  mean_texture_coordinate: number[];
  quality?: { known: number; interpolated: number; sum_sigma_m: number };
}

const folder = join(__dirname, '../../../tests/conformance/grid_v1');
const { sequences, refused } = JSON.parse(readFileSync(join(folder, 'expected.json'), 'utf8')) as {
  sequences: Expected[][];
  refused: string[];
};
const load = (name: string): Uint8Array => new Uint8Array(readFileSync(join(folder, name)));

const add = (hash: number, value: number): number => Math.imul(hash ^ value, 0x01000193);
const column = (values: Float32Array, width: number, at: number): number[] =>
  Array.from({ length: values.length / width }, (_, i) => values[i * width + at]!);
const mean = (values: number[]): number => values.reduce((sum, x) => sum + x, 0) / values.length;

function placeHash(grid: Grid): number {
  let hash = 0x811c9dc5;
  for (let line = 0; line < grid.lines; ++line) {
    for (let b = 0; b < grid.boundaries; ++b) {
      const c = grid.columns[line * grid.stride + kMargin + b]!;
      if (c !== kAbsent) hash = add(add(add(hash, line), b), c << (8 - grid.stepBits));
    }
  }
  return hash >>> 0;
}

function area({ positions: p, triangles }: GridSurface): number {
  let sum = 0;
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [triangles[t]! * 3, triangles[t + 1]! * 3, triangles[t + 2]! * 3];
    const u = [0, 1, 2].map((i) => p[b + i]! - p[a + i]!) as [number, number, number];
    const v = [0, 1, 2].map((i) => p[c + i]! - p[a + i]!) as [number, number, number];
    sum += Math.hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]) / 2;
  }
  return sum;
}

describe('frozen grids', () => {
  it.each(sequences.map((s) => [s[0]!.file, s] as const))('%s and what builds on it are read as in C++', (_, sequence) => {
    const frames = new GridFrames();
    let key: KeyGrid | null = null;
    for (const expected of sequence) {
      const frame = parseFrame(load(expected.file));
      expect(frame.isKey).toBe(expected.key);
      const { grid } = decodeGrid(frame.geometry, frame.header.vertices, frame.header.triangles, key);
      if (frame.isKey) key = { id: gridId(frame.geometry), grid };
      expect(placeHash(grid)).toBe(expected.place_hash);
      const surface = frames.decode(frame);
      expect(frame.header.number).toBe(BigInt(expected.number));
      expect(surface.positions.length).toBe(expected.vertices * 3);
      expect(surface.triangles.length).toBe(expected.triangles * 3);
      expect(surface.triangles.reduce(add, 0x811c9dc5) >>> 0).toBe(expected.triangle_hash);
      expect(Math.abs(area(surface) - expected.area_m2)).toBeLessThan(1e-4);
      for (let axis = 0; axis < 3; ++axis) {
        const values = column(surface.positions, 3, axis);
        expect(Math.abs(Math.min(...values) - expected.min[axis]!)).toBeLessThan(1e-4);
        expect(Math.abs(Math.max(...values) - expected.max[axis]!)).toBeLessThan(1e-4);
        expect(Math.abs(mean(values) - expected.mean[axis]!)).toBeLessThan(1e-5);
      }
      expected.mean_texture_coordinate.forEach((value, axis) => {
        expect(Math.abs(mean(column(surface.coordinates, 2, axis)) - value)).toBeLessThan(1e-5);
      });
      expect(surface.quality !== null).toBe(expected.quality !== undefined);
      if (expected.quality === undefined || surface.quality === null) continue;
      const { sigmas, interpolated } = surface.quality;
      expect(Math.abs(sigmas.reduce((sum, s) => sum + s, 0) - expected.quality.sum_sigma_m)).toBeLessThan(1e-6);
      expect(sigmas.filter((s) => s > 0).length).toBe(expected.quality.known);
      expect(interpolated.filter((i) => i === 1).length).toBe(expected.quality.interpolated);
    }
  });

  it.each(refused)('%s is refused', (name) => {
    expect(() => new GridFrames().decode(parseFrame(load(name)))).toThrow();
  });

  it('a delta frame waits for its own key frame', () => {
    const frames = new GridFrames();
    const read = (name: string): GridSurface => frames.decode(parseFrame(load(name)));
    expect(() => read('delta_1.rlv')).toThrow(/key frame/);
    read('delta_0.rlv');
    read('delta_2.rlv');
    read('delta_3.rlv');
    expect(() => read('delta_1.rlv')).toThrow(/key frame/);
    read('delta_4.rlv');
  });
});

describe('damaged grids', () => {
  it('give an error or a surface, and the next frame decodes', () => {
    let random = 7;
    const next = (): number => (random = (Math.imul(random, 1664525) + 1013904223) >>> 0) >>> 8;
    let refusals = 0;
    for (const name of ['plain.rlv', 'quality.rlv', 'lenses.rlv']) {
      const whole = load(name);
      const frames = new GridFrames();
      for (let i = 0; i < 300; ++i) {
        const bytes = whole.slice();
        for (let k = 0; k < 3; ++k) bytes[72 + (next() % (bytes.length - 72))] = next() & 255;
        try {
          const { positions, triangles } = frames.decode(parseFrame(bytes));
          expect(triangles.every((index) => index < positions.length / 3)).toBe(true);
          expect(positions.every(Number.isFinite)).toBe(true);
        } catch (error) {
          expect((error as Error).message).toMatch(/geometry|frame/);
          ++refusals;
        }
      }
      expect(frames.decode(parseFrame(whole)).positions.length).toBeGreaterThan(1000);
    }
    expect(refusals).toBeGreaterThan(300);
  });

  it('are refused wherever they are cut', () => {
    const { geometry, header } = parseFrame(load('quality.rlv'));
    for (let size = 0; size < geometry.length; ++size) {
      expect(() => decodeGrid(geometry.subarray(0, size), header.vertices, header.triangles, null), `${size}`).toThrow();
    }
  });
});
