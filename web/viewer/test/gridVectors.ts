// SPDX-License-Identifier: Apache-2.0
// Frozen grids, and what a surface must be to be what C++ made of them.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { expect } from 'vitest';
import type { Frame } from '../src/frame';
import { kAbsent, kMargin, type Grid } from '../src/gridDecoder';
import type { GridSurface } from '../src/gridPoints';

export interface Expected {
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

export interface Vectors {
  sequences: Expected[][];
  refused: string[];
  load(name: string): Uint8Array;
}

export function vectors(codec: string): Vectors {
  const folder = join(__dirname, '../../../tests/conformance', codec);
  const load = (name: string): Uint8Array => new Uint8Array(readFileSync(join(folder, name)));
  const told = JSON.parse(new TextDecoder().decode(load('expected.json'))) as Omit<Vectors, 'load'>;
  return { ...told, load };
}

const add = (hash: number, value: number): number => Math.imul(hash ^ value, 0x01000193);
const column = (values: Float32Array, width: number, at: number): number[] =>
  Array.from({ length: values.length / width }, (_, i) => values[i * width + at]!);
const mean = (values: number[]): number => values.reduce((sum, x) => sum + x, 0) / values.length;

export function placeHash(grid: Grid): number {
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

/** As C++ has it: exactly where numbers are whole. */
export function expectSurface(frame: Frame, surface: GridSurface, expected: Expected): void {
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
  if (expected.quality === undefined || surface.quality === null) return;
  const { sigmas, interpolated } = surface.quality;
  expect(Math.abs(sigmas.reduce((sum, s) => sum + s, 0) - expected.quality.sum_sigma_m)).toBeLessThan(1e-6);
  expect(sigmas.filter((s) => s > 0).length).toBe(expected.quality.known);
  expect(interpolated.filter((i) => i === 1).length).toBe(expected.quality.interpolated);
}
