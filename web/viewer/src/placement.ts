// SPDX-License-Identifier: Apache-2.0
// Where the surfaces of several rigs stand in one scene. A calibration knows its own camera's frame alone, so nothing
// says where one rig stands to another: they stand side by side, or all in one frame where a person wants that. Pure.
import type { Extent } from './surface';

export const kPlacements = ['beside', 'together'] as const;
export type Placement = (typeof kPlacements)[number];

const kGap = 0.15; // of the first one's width

/** How far each is moved to the right, metres; the first stays. Of a surface not seen yet: null, and nothing is kept free. */
export function placed(extents: readonly (Extent | null)[], placement: Placement): number[] {
  const [first] = extents;
  if (placement === 'together' || !first) return extents.map(() => 0);
  const gap = kGap * (first.max[0] - first.min[0]);
  let right = first.max[0];
  return extents.map((extent, i) => {
    if (i === 0 || extent === null) return 0;
    const offset = right + gap - extent.min[0];
    right = extent.max[0] + offset;
    return offset;
  });
}

/** Around all of them where they stand; null: there is none. */
export function around(extents: readonly (Extent | null)[], offsets: readonly number[]): Extent | null {
  let all: Extent | null = null;
  for (const [i, extent] of extents.entries()) {
    if (extent === null) continue;
    const min: Extent['min'] = [extent.min[0] + offsets[i]!, extent.min[1], extent.min[2]];
    const max: Extent['max'] = [extent.max[0] + offsets[i]!, extent.max[1], extent.max[2]];
    if (all !== null) {
      for (const axis of [0, 1, 2] as const) {
        min[axis] = Math.min(min[axis], all.min[axis]);
        max[axis] = Math.max(max[axis], all.max[axis]);
      }
    }
    const centre = min.map((low, axis) => (low + max[axis]!) / 2) as Extent['centre'];
    all = { min, max, centre };
  }
  return all;
}
