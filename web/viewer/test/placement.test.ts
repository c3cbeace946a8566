// SPDX-License-Identifier: Apache-2.0
// Proves: surfaces of several rigs stand side by side without touching, and the box around them holds them all.
import { describe, expect, it } from 'vitest';
import { around, placed } from '../src/placement';
import type { Extent } from '../src/surface';

const extent = (from: number, to: number, near = 1): Extent => ({
  min: [from, -0.2, near],
  max: [to, 0.2, near + 0.5],
  centre: [(from + to) / 2, 0, near + 0.25],
});
const kThree = [extent(-0.5, 0.5), extent(-0.1, 0.1, 2), extent(-1, 0)];

describe('placed', () => {
  it('stands side by side with a gap, the first where its camera sees it', () => {
    const offsets = placed(kThree, 'beside');
    expect(offsets[0]).toBe(0);
    for (const i of [1, 2]) {
      expect(kThree[i]!.min[0] + offsets[i]! - kThree[i - 1]!.max[0] - offsets[i - 1]!).toBeCloseTo(0.15, 9);
    }
  });
  it('keeps nothing free for what is not seen yet', () => {
    const offsets = placed([kThree[0]!, null, kThree[2]!], 'beside');
    expect(offsets[1]).toBe(0);
    expect(offsets[2]! + kThree[2]!.min[0]).toBeCloseTo(0.65, 9);
    expect(placed([null, kThree[1]!], 'beside')).toEqual([0, 0]);
  });
  it('moves none where all are in one frame', () => expect(placed(kThree, 'together')).toEqual([0, 0, 0]));
});

describe('around', () => {
  it('holds them all', () => {
    const offsets = placed(kThree, 'beside');
    const box = around(kThree, offsets)!;
    expect(box.min).toEqual([-0.5, -0.2, 1]);
    expect(box.max[0]).toBeCloseTo(kThree[2]!.max[0] + offsets[2]!, 9);
    expect(box.max[2]).toBe(2.5);
    expect(around([null], [0])).toBeNull();
  });
});
