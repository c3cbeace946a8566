// SPDX-License-Identifier: Apache-2.0
// Proves: the frozen grids in Draco decode here, with the published draco3d, to what they decode to in C++; others are refused.
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { beforeAll, describe, expect, it } from 'vitest';
import { DracoDecoder } from '../src/draco';
import { decodeDracoGrid } from '../src/dracoGrid';
import { parseFrame } from '../src/frame';
import { GridFrames } from '../src/grid';
import type { GridSurface } from '../src/gridPoints';
import { expectSurface, placeHash, vectors } from './gridVectors';

const { sequences, refused, load } = vectors('draco_grid_v1');

let draco: DracoDecoder;
beforeAll(async () => {
  const wasm = readFileSync(createRequire(import.meta.url).resolve('draco3d/draco_decoder.wasm'));
  draco = await DracoDecoder.create(new Uint8Array(wasm).buffer);
});

describe('frozen grids in Draco', () => {
  it.each(sequences.map(([only]) => [only!.file, only!] as const))('%s is read as in C++', (file, expected) => {
    const frame = parseFrame(load(file));
    expect(frame.isKey).toBe(true);
    const { grid } = decodeDracoGrid(frame.geometry, frame.header.vertices, frame.header.triangles, draco);
    expect(placeHash(grid)).toBe(expected.place_hash);
    expectSurface(frame, new GridFrames().decodeInDraco(frame, draco), expected);
  });

  it.each(refused)('%s is refused', (name) => {
    expect(() => new GridFrames().decodeInDraco(parseFrame(load(name)), draco)).toThrow();
  });

  it('one of another rig takes the key frame of delta grids away', () => {
    const grids = vectors('grid_v1');
    const frames = new GridFrames();
    const delta = (name: string): GridSurface => frames.decode(parseFrame(grids.load(name)));
    delta('delta_0.rlv');
    frames.decodeInDraco(parseFrame(load('lenses.rlv')), draco);
    expect(() => delta('delta_1.rlv')).toThrow(/key frame/);
  });
});

describe('damaged grids in Draco', () => {
  it('give an error or a surface, and the next frame decodes', () => {
    let random = 7;
    const next = (): number => (random = (Math.imul(random, 1664525) + 1013904223) >>> 0) >>> 8;
    let refusals = 0;
    const frames = new GridFrames();
    for (const name of ['plain.rlv', 'quality.rlv', 'lenses.rlv', 'twice.rlv']) {
      const whole = load(name);
      for (let i = 0; i < 200; ++i) {
        const bytes = whole.slice();
        for (let k = 0; k < 3; ++k) bytes[72 + (next() % (bytes.length - 72))] = next() & 255;
        try {
          const { positions, triangles } = frames.decodeInDraco(parseFrame(bytes), draco);
          expect(triangles.every((index) => index < positions.length / 3)).toBe(true);
          expect(positions.every(Number.isFinite)).toBe(true);
        } catch (error) {
          expect((error as Error).message).toMatch(/geometry|frame/);
          ++refusals;
        }
      }
      expect(frames.decodeInDraco(parseFrame(whole), draco).positions.length).toBeGreaterThan(1000);
    }
    expect(refusals).toBeGreaterThan(200);
  });

  it('are refused wherever they are cut', () => {
    const { geometry, header } = parseFrame(load('quality.rlv'));
    for (let size = 0; size < geometry.length; ++size) {
      expect(
        () => decodeDracoGrid(geometry.subarray(0, size), header.vertices, header.triangles, draco),
        `${size}`,
      ).toThrow();
    }
  });
});
