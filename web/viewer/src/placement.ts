// SPDX-License-Identifier: Apache-2.0
// Where the surfaces of several rigs stand in one scene, the first in its camera's frame. A calibration knows its own
// camera's frame alone, unless rig.yaml says where that stands in a frame of all rigs. Where it does, or a person has shown places
// that two rigs both see, the motion between them is known; else
// surfaces stand side by side, or all in one frame where a person wants that. Pure.
import { combined, inverse, kNowhere, moved, toTheRight, type Rigid } from './rigid';
import type { StreamInfo } from './protocol';
import type { Vec3 } from './pick';
import type { Box, Extent } from './surface';

export const kPlacements = ['beside', 'together'] as const;
export type Placement = (typeof kPlacements)[number];

const kGap = 0.15; // of the first one's width

/**
 * What brings each into the first one's frame. `known`: of those that have a place, which keep it. Of a surface not seen
 * yet: null, and nothing is kept free.
 */
export function placed(
  extents: readonly (Extent | null)[],
  placement: Placement,
  known: readonly (Rigid | null)[] = [],
): Rigid[] {
  const [first] = extents;
  if (placement === 'together' || !first) return extents.map((_, i) => known[i] ?? kNowhere);
  const gap = kGap * (first.max[0] - first.min[0]);
  const standing = extents.map((extent, i) => (extent !== null && known[i] != null ? boxAround(extent, known[i]).max[0] : -Infinity));
  let right = Math.max(first.max[0], ...standing);
  return extents.map((extent, i) => {
    if (known[i] != null) return known[i];
    if (i === 0 || extent === null) return kNowhere;
    const offset = right + gap - extent.min[0];
    right = extent.max[0] + offset;
    return toTheRight(offset);
  });
}

/** Where its rig says that its camera stands in the frame of all rigs; null: it does not. */
export function rigPlace(info: StreamInfo): Rigid | null {
  const { world_from_camera_rotation: rotation, world_from_camera_translation: translation } = info;
  const isPlace = rotation?.length === 9 && translation?.length === 3 && [...rotation, ...translation].every(Number.isFinite);
  return isPlace ? { rotation, translation: translation as Vec3 } : null;
}

/** What brings one camera's frame into the first one's, of their places in the frame of all rigs. */
export function between(first: Rigid | null | undefined, other: Rigid | null | undefined): Rigid | null {
  return first && other ? combined(inverse(first), other) : null;
}

/** Around all of them where they stand; null: there is none. */
export function around(extents: readonly (Extent | null)[], poses: readonly Rigid[]): Extent | null {
  const boxes = extents.flatMap((extent, i) => (extent === null ? [] : [boxAround(extent, poses[i]!)]));
  if (boxes.length === 0) return null;
  const { min, max } = joined(boxes);
  const deep = joined(
    extents.flatMap((extent, i) => (extent === null ? [] : [boxAround(deepened(extent), poses[i]!)])),
  );
  return { min, max, centre: min.map((low, axis) => (low + max[axis]!) / 2) as Vec3, depths: [deep.min[2], deep.max[2]] };
}

function boxAround({ min, max }: Box, pose: Rigid): Box {
  const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((c) =>
    moved(pose, [0, 1, 2].map((axis) => (c & (1 << axis) ? max : min)[axis]!) as Vec3),
  );
  return { min: least(corners), max: most(corners) };
}

const deepened = ({ min, max, depths }: Extent): Box => ({ min: [min[0], min[1], depths[0]], max: [max[0], max[1], depths[1]] });
const joined = (boxes: Box[]): Box => ({ min: least(boxes.map((box) => box.min)), max: most(boxes.map((box) => box.max)) });
const least = (points: Vec3[]): Vec3 => [0, 1, 2].map((axis) => Math.min(...points.map((p) => p[axis]!))) as Vec3;
const most = (points: Vec3[]): Vec3 => [0, 1, 2].map((axis) => Math.max(...points.map((p) => p[axis]!))) as Vec3;
