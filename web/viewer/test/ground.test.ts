// SPDX-License-Identifier: Apache-2.0
// Proves: floor and axes are of whole metres around the surface, and their numbers are those of their places.
import { expect, it } from 'vitest';
import { groundLabels, groundLines, groundRanges } from '../src/ground';
import type { Extent } from '../src/surface';

const extent: Extent = { min: [-0.48, -0.36, 1.02], max: [0.48, 0.36, 1.215], centre: [0, 0, 1.12], depths: [1, 1.25] };

it('surrounds the surface by whole steps', () => {
  const { x, y, z, step } = groundRanges(extent, null);
  const expected = [[-0.5, 0.5], [-0.4, 0.4], [1.02, 1.22]] as const;
  for (const [i, range] of [x, y, z].entries()) {
    expect(range.from).toBeCloseTo(expected[i]![0], 9);
    expect(range.to).toBeCloseTo(expected[i]![1], 9);
  }
  expect(step).toBeCloseTo(0.1, 9);
});

it('stays while the surface moves a little', () => {
  const ranges = groundRanges(extent, null);
  expect(groundRanges({ ...extent, min: [-0.47, -0.35, 1.03] }, ranges)).toBe(ranges);
  expect(groundRanges({ ...extent, max: [0.62, 0.36, 1.215] }, ranges).x.to).toBeCloseTo(0.8, 9);
});

it('lies under the surface, with a line a step', () => {
  const ranges = groundRanges(extent, null);
  const lines = groundLines(ranges);
  for (const [, y] of lines) expect(y).toBe(ranges.y.to); // the camera's frame counts downwards
  const across = new Set(lines.map(([x]) => Math.round(x * 1000)));
  for (let mm = -500; mm <= 500; mm += 100) expect(across).toContain(mm);
});

it('says where places are: to the right, up and away', () => {
  const said = groundLabels(groundRanges(extent, null));
  for (const [i, sign] of [1, -1, 1].entries()) {
    const of = said.filter(({ colour }) => colour === `--axis-${'xyz'[i]!}`);
    expect(of.length).toBeGreaterThan(2);
    for (const { at, text } of of) expect(Number(text)).toBeCloseTo(sign * at[i]!, 9);
  }
});
