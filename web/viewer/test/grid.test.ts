// SPDX-License-Identifier: Apache-2.0
// Proves: the frozen grids decode here to what they decode to in C++, exactly where numbers are whole, and so in WebAssembly;
// others are refused; damaged ones give in both the same error or the same surface.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { describe, expect, it } from 'vitest';
import { parseFrame } from '../src/frame';
import { GridFrames } from '../src/grid';
import { decodeSlices, openGrid, type CodedGrid, type Grid, type KeyGrid } from '../src/gridDecoder';
import { gridId } from '../src/gridHead';
import { GridKernel } from '../src/gridKernel';
import type { GridSurface } from '../src/gridPoints';
import { expectSurface, placeHash, vectors } from './gridVectors';

const { sequences, refused, load } = vectors('grid_v1');

const kernel = await GridKernel.create(readFileSync(join(__dirname, '../src/grid.wasm')));
const framesWith = (by: GridKernel | null): GridFrames => {
  const frames = new GridFrames();
  frames.kernel = by;
  return frames;
};
const gridOf = (coded: CodedGrid, by: GridKernel | null): Grid => {
  if (by === null) return decodeSlices(coded);
  expect(by.takes(coded.head)).toBe(true);
  by.decode(coded);
  return by.copy();
};

describe.each([
  ['in TypeScript', null],
  ['in WebAssembly', kernel],
] as const)('frozen grids %s', (_, by) => {
  it.each(sequences.map((s) => [s[0]!.file, s] as const))('%s and what builds on it are read as in C++', (__, sequence) => {
    const frames = framesWith(by);
    let key: KeyGrid | null = null;
    for (const expected of sequence) {
      const frame = parseFrame(load(expected.file));
      expect(frame.isKey).toBe(expected.key);
      const grid = gridOf(openGrid(frame.geometry, frame.header.vertices, frame.header.triangles, key), by);
      if (frame.isKey) key = { id: gridId(frame.geometry), grid };
      expect(placeHash(grid)).toBe(expected.place_hash);
      const surface = frames.decode(frame);
      expectSurface(frame, surface, expected);
    }
  });

  it.each(refused)('%s is refused', (name) => {
    expect(() => framesWith(by).decode(parseFrame(load(name)))).toThrow();
  });

  it('a delta frame waits for its own key frame', () => {
    const frames = framesWith(by);
    const read = (name: string): GridSurface => frames.decode(parseFrame(load(name)));
    expect(() => read('delta_1.rlv')).toThrow(/key frame/);
    read('delta_0.rlv');
    read('delta_2.rlv');
    read('delta_3.rlv');
    expect(() => read('delta_1.rlv')).toThrow(/key frame/);
    read('delta_4.rlv');
  });
});

const bytesOf = (array: ArrayBufferView): Buffer => Buffer.from(array.buffer, array.byteOffset, array.byteLength);
/** What it gives, or what was thrown. */
const outcome = <T>(of: () => T): T | string => {
  try {
    return of();
  } catch (error) {
    return (error as Error).message;
  }
};

describe('damaged grids', () => {
  it('give the same error or the same surface both ways, and the next frame decodes', () => {
    let random = 7;
    const next = (): number => (random = (Math.imul(random, 1664525) + 1013904223) >>> 0) >>> 8;
    let refusals = 0;
    for (const name of ['plain.rlv', 'quality.rlv', 'lenses.rlv', 'slices.rlv', 'wild.rlv', 'twice_0.rlv']) {
      const whole = load(name);
      const [frames, others] = [framesWith(null), framesWith(kernel)];
      let spare: ArrayBuffer[] = []; // of the surface before, which nobody looks at any more
      for (let i = 0; i < 300; ++i) {
        const bytes = whole.slice();
        for (let k = 0; k < 3; ++k) bytes[72 + (next() % (bytes.length - 72))] = next() & 255;
        const surface = outcome(() => frames.decode(parseFrame(bytes)));
        const other = outcome(() => others.decode(parseFrame(bytes)));
        if (typeof surface === 'string' || typeof other === 'string') {
          expect(other).toBe(surface);
          expect(surface).toMatch(/geometry|frame/);
          ++refusals;
          continue;
        }
        const { positions, triangles } = other;
        others.spares.add(spare);
        spare = [positions, other.coordinates, triangles].map((array) => array.buffer);
        expect(triangles.every((index) => index < positions.length / 3)).toBe(true);
        expect(positions.every(Number.isFinite)).toBe(true);
        expect(bytesOf(triangles).equals(bytesOf(surface.triangles))).toBe(true);
        expect(positions.length).toBe(surface.positions.length);
        expect(positions.every((x, n) => Math.abs(x - surface.positions[n]!) <= 1e-3 * Math.abs(surface.positions[n - (n % 3) + 2]!))).toBe(true);
      }
      // Of memory that frames before it have filled.
      for (const each of [frames, others]) expect(each.decode(parseFrame(whole)).positions.length).toBeGreaterThan(1000);
    }
    expect(refusals).toBeGreaterThan(300);
  });

  it.each([
    ['in TypeScript', null],
    ['in WebAssembly', kernel],
  ] as const)('are refused wherever they are cut, %s', (_, by) => {
    const { geometry, header } = parseFrame(load('quality.rlv'));
    for (let size = 0; size < geometry.length; ++size) {
      expect(() => gridOf(openGrid(geometry.subarray(0, size), header.vertices, header.triangles, null), by), `${size}`).toThrow();
    }
  });
});

describe('grids in WebAssembly', () => {
  it.each(sequences.map((s) => [s[0]!.file, s] as const))('%s and what builds on it are the same places, cells and marks', (_, sequence) => {
    let key: KeyGrid | null = null;
    for (const { file } of sequence) {
      const { geometry, header } = parseFrame(load(file));
      const coded = openGrid(geometry, header.vertices, header.triangles, key);
      const [here, there] = [gridOf(coded, null), gridOf(coded, kernel)];
      for (const name of ['columns', 'cells', 'sigmas', 'interpolated'] as const) {
        const [a, b] = [here[name], there[name]];
        if (a === null || b === null) expect(a).toBe(b);
        else expect(bytesOf(a).equals(bytesOf(b)), `${file}: ${name}`).toBe(true);
      }
      expect([there.vertices, there.triangles]).toEqual([here.vertices, here.triangles]);
      if (coded.head.isKey) key = { id: gridId(geometry), grid: here };
    }
  });
});
