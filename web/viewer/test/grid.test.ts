// SPDX-License-Identifier: Apache-2.0
// Proves: the frozen grids decode here to what they decode to in C++, exactly where numbers are whole; others are refused.
import { describe, expect, it } from 'vitest';
import { parseFrame } from '../src/frame';
import { GridFrames } from '../src/grid';
import { decodeGrid, type KeyGrid } from '../src/gridDecoder';
import { gridId } from '../src/gridHead';
import type { GridSurface } from '../src/gridPoints';
import { expectSurface, placeHash, vectors } from './gridVectors';

const { sequences, refused, load } = vectors('grid_v1');

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
      expectSurface(frame, surface, expected);
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
