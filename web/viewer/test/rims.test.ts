// SPDX-License-Identifier: Apache-2.0
// Proves: a rim that runs in steps is drawn nearly straight, of no triangle but the outermost ones anything is left
// out, and what is narrow stays whole.
import { describe, expect, it } from 'vitest';
import { kRimCut, vertexRims } from '../src/rims';

const kWidth = 8; // of a stripe, pixels

/** A grid of lines, each of which has its vertices from column `from` to column `to`, both whole. */
function grid(lines: number, from: (line: number) => number, to: number) {
  const place = new Map<string, number>();
  const coordinates: number[] = [];
  for (let line = 0; line < lines; ++line) {
    for (let column = from(line); column <= to; ++column) {
      place.set(`${line},${column}`, place.size);
      coordinates.push(column * kWidth, line);
    }
  }
  const triangles: number[] = [];
  for (let line = 1; line < lines; ++line) {
    for (let column = Math.max(from(line), from(line - 1)) + 1; column <= to; ++column) {
      const at = (l: number, c: number): number => place.get(`${l},${c}`)!;
      const [a, b, c, d] = [at(line - 1, column - 1), at(line - 1, column), at(line, column), at(line, column - 1)];
      triangles.push(a, d, c, a, c, b);
    }
  }
  return { place, rims: vertexRims(new Float32Array(coordinates), new Uint32Array(triangles)) };
}

/** Where the rim is drawn in a line, pixels. */
function rimAt(line: number, from: number, to: number, { place, rims }: ReturnType<typeof grid>): number {
  const at = (column: number): number => rims[place.get(`${line},${column}`)!]!;
  if (at(from) >= kRimCut) return from * kWidth;
  for (let column = from + 1; column <= to; ++column) {
    if (at(column) < kRimCut) continue;
    return (column - 1 + (kRimCut - at(column - 1)) / (at(column) - at(column - 1))) * kWidth;
  }
  return Infinity;
}

describe('vertexRims', () => {
  it('makes a slope of steps', () => {
    const kSlope = 8; // lines a stripe
    const from = (line: number): number => Math.floor(line / kSlope);
    const sloping = grid(100, from, 20);
    // How far from a straight line, whose place does not matter.
    const spread = (places: number[]): number => {
      const off = places.map((place, i) => place - (i * kWidth) / kSlope);
      const mean = off.reduce((a, b) => a + b) / off.length;
      return Math.sqrt(off.reduce((sum, o) => sum + (o - mean) ** 2, 0) / off.length);
    };
    const lines = Array.from({ length: 60 }, (_, i) => 20 + i);
    const steps = lines.map((line) => from(line) * kWidth);
    const drawn = lines.map((line) => rimAt(line, from(line), 20, sloping));
    for (const [i, place] of drawn.entries()) expect(place - steps[i]!).toBeLessThan(1.25 * kWidth);
    expect(spread(drawn)).toBeLessThan(0.4 * spread(steps));
  });

  it('leaves an upright rim upright', () => {
    const upright = grid(60, () => 3, 20);
    const places = Array.from({ length: 10 }, (_, i) => rimAt(25 + i, 3, 20, upright));
    expect(Math.max(...places) - Math.min(...places)).toBeLessThan(0.02 * kWidth);
    expect(places[0]).toBeCloseTo(3.5 * kWidth, 0);
  });

  it('leaves out no more than a part of the outermost triangles', () => {
    const from = (line: number): number => 3 + Math.round(3 * Math.sin(line)); // as ragged as can be
    const ragged = grid(100, from, 20);
    for (let line = 2; line < 98; ++line) {
      const inner = Math.max(from(line - 1), from(line), from(line + 1)) + 1;
      expect(ragged.rims[ragged.place.get(`${line},${inner}`)!]).toBeGreaterThan(kRimCut);
    }
  });

  it('draws all of a strip of one stripe', () => {
    const strip = grid(40, () => 5, 6);
    expect(Math.min(...strip.rims)).toBeGreaterThan(kRimCut);
  });

  it('is nothing without a surface', () => expect(vertexRims(new Float32Array(0), new Uint32Array(0)).length).toBe(0));
});
