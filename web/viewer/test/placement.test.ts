// SPDX-License-Identifier: Apache-2.0
// Proves: surfaces of several rigs stand side by side without touching, or where they were placed, and the box around
// them holds them all.
import { describe, expect, it } from 'vitest';
import { around, between, placed, rigPlace } from '../src/placement';
import type { StreamInfo } from '../src/protocol';
import { kNowhere, moved, rigidOf } from '../src/rigid';
import type { Extent } from '../src/surface';

const extent = (from: number, to: number, near = 1): Extent => ({
  min: [from, -0.2, near],
  max: [to, 0.2, near + 0.5],
  centre: [(from + to) / 2, 0, near + 0.25],
  depths: [near - 0.1, near + 0.6],
});
const kThree = [extent(-0.5, 0.5), extent(-0.1, 0.1, 2), extent(-1, 0)];
const right = (poses: ReturnType<typeof placed>): number[] => poses.map(({ translation }) => translation[0]);

describe('of rigs that say where they stand', () => {
  const [first, other] = [rigidOf([0, 0.4, 0.1], [1, -2, 0.5]), rigidOf([0.2, -0.9, 0], [3, 0.1, 4])];
  it('one is brought into the frame of the other', () => {
    const point = [0.1, 0.2, 1.3] as const;
    const there = moved(first, moved(between(first, other)!, [...point]));
    moved(other, [...point]).forEach((c, axis) => expect(there[axis]).toBeCloseTo(c, 12));
    expect(between(first, null)).toBeNull();
    expect(between(undefined, other)).toBeNull();
  });
  it('what is no place is none', () => {
    const { rotation, translation } = first;
    const said = (r: unknown, t: unknown): ReturnType<typeof rigPlace> =>
      rigPlace({ world_from_camera_rotation: r, world_from_camera_translation: t } as StreamInfo);
    expect(said(rotation, translation)).toEqual(first);
    for (const [r, t] of [[undefined, translation], [rotation, undefined], [rotation.slice(1), translation], [rotation, [1, 2, NaN]]]) {
      expect(said(r, t)).toBeNull();
    }
  });
});

describe('placed', () => {
  it('stands side by side with a gap, the first where its camera sees it', () => {
    const offsets = right(placed(kThree, 'beside'));
    expect(offsets[0]).toBe(0);
    for (const i of [1, 2]) {
      expect(kThree[i]!.min[0] + offsets[i]! - kThree[i - 1]!.max[0] - offsets[i - 1]!).toBeCloseTo(0.15, 9);
    }
  });
  it('keeps nothing free for what is not seen yet', () => {
    const offsets = right(placed([kThree[0]!, null, kThree[2]!], 'beside'));
    expect(offsets[1]).toBe(0);
    expect(offsets[2]! + kThree[2]!.min[0]).toBeCloseTo(0.65, 9);
    expect(right(placed([null, kThree[1]!], 'beside'))).toEqual([0, 0]);
  });
  it('moves none where all are in one frame', () => expect(placed(kThree, 'together')).toEqual([kNowhere, kNowhere, kNowhere]));
  it('leaves those where they are that have a place, and others clear of them', () => {
    const known = rigidOf([0, -Math.PI / 2, 0], [0.5, 0, 1]); // its z is to the left: 2 to 2.5 m that way
    const poses = placed(kThree, 'beside', [null, known, null]);
    expect(poses[1]).toBe(known);
    expect(poses[2]!.translation[0] + kThree[2]!.min[0]).toBeCloseTo(0.65, 9);
    const away = rigidOf([0, 0, 0], [3, 0, 0]);
    expect(placed(kThree, 'beside', [null, away, null])[2]!.translation[0] + kThree[2]!.min[0]).toBeCloseTo(3.25, 9);
    expect(placed(kThree, 'together', [null, away, null])[1]).toBe(away);
  });
});

describe('around', () => {
  it('holds them all', () => {
    const poses = placed(kThree, 'beside');
    const box = around(kThree, poses)!;
    expect(box.min).toEqual([-0.5, -0.2, 1]);
    expect(box.max[0]).toBeCloseTo(kThree[2]!.max[0] + right(poses)[2]!, 9);
    expect(box.max[2]).toBe(2.5);
    expect(box.depths).toEqual([0.9, 2.6]);
    expect(around([null], [kNowhere])).toBeNull();
  });
  it('also what is turned', () => {
    const box = around([kThree[1]!], [rigidOf([0, Math.PI / 2, 0], [0, 0, 1])])!;
    expect(box.min[0]).toBeCloseTo(2, 9); // depth is to the right now
    expect(box.max[0]).toBeCloseTo(2.5, 9);
    expect(box.max[2]).toBeCloseTo(1.1, 9);
  });
});
