// SPDX-License-Identifier: Apache-2.0
// A floor of squares under the surface and three axes at its corner, in metres of the rig camera's frame. Pure.
import { metres, niceStep, steadyRange, ticks, type Range } from './palette';
import type { Vec3 } from './pick';
import type { Extent } from './surface';

const kSquares = 12; // at most, along the longest side
const kLabels = 6;

export interface Label {
  at: Vec3; // rig camera's frame
  text: string;
  colour: string; // a property of style.css
}

export interface Ranges {
  x: Range;
  y: Range;
  z: Range;
  step: number; // of the squares
}

/** Of whole steps around the surface; the old ones while they still serve. */
export function groundRanges(extent: Extent, old: Ranges | null): Ranges {
  const [x, y, z] = [0, 1, 2].map((i) =>
    steadyRange(extent.min[i]!, extent.max[i]!, old === null ? null : [old.x, old.y, old.z][i]!),
  ) as [Range, Range, Range];
  const kept = old !== null && x === old.x && y === old.y && z === old.z;
  if (kept) return old;
  const longest = Math.max(x.to - x.from, z.to - z.from);
  const step = niceStep(longest, kSquares);
  return { x, y, z, step };
}

/** Pairs of points. */
export function groundLines({ x, y, z, step }: Ranges): Vec3[] {
  const lines: Vec3[] = [];
  for (const at of [x.from, ...ticks(x, step), x.to]) lines.push([at, y.to, z.from], [at, y.to, z.to]);
  for (const at of [z.from, ...ticks(z, step), z.to]) lines.push([x.from, y.to, at], [x.to, y.to, at]);
  return lines;
}

/** Height counts upwards, as people do; x to the right and z away from the camera. */
export function groundLabels({ x, y, z }: Ranges): Label[] {
  const labels: Label[] = [];
  const along = (range: Range, axis: number, place: (v: number) => Vec3, sign = 1): void => {
    const step = niceStep(range.to - range.from, kLabels);
    for (const v of ticks(range, step)) {
      labels.push({ at: place(v), text: metres(sign * v, step), colour: `--axis-${'xyz'[axis]}` });
    }
  };
  along(x, 0, (v) => [v, y.to, z.from]);
  along(z, 2, (v) => [x.to, y.to, v]);
  along(y, 1, (v) => [x.from, v, z.to], -1);
  return labels;
}

export class Ground {
  /** Null before there is a surface. */
  ranges: Ranges | null = null;
  labels: readonly Label[] = [];

  get step(): number | null {
    return this.ranges?.step ?? null;
  }

  setExtent(extent: Extent): void {
    const ranges = groundRanges(extent, this.ranges);
    if (ranges === this.ranges) return;
    this.ranges = ranges;
    this.labels = groundLabels(ranges);
  }
}
