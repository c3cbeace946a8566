// SPDX-License-Identifier: Apache-2.0
// A rectangle of the rig camera's picture, and the depths of a surface in it, as codec/depth_picture. Pure.
import { pixelOf, type Lens } from './lens';

/** Pixels. */
export interface Region {
  readonly column: number;
  readonly row: number;
  readonly width: number;
  readonly height: number;
}

interface Size {
  width: number;
  height: number;
}

/** The middle of the picture, .4 of it each way, as `relievo measure` takes it. */
export function middleRegion(camera: Size): Region {
  const [width, height] = [camera.width, camera.height].map((all) => Math.max(1, Math.floor((all * 2) / 5))) as [number, number];
  return { column: Math.floor((camera.width - width) / 2), row: Math.floor((camera.height - height) / 2), width, height };
}

/** Between two pixels, both of them in it. */
export function regionBetween(a: readonly [number, number], b: readonly [number, number], camera: Size): Region {
  const within = (at: number, count: number): number => Math.min(count - 1, Math.max(0, Math.round(at)));
  const [c0, c1] = [within(a[0], camera.width), within(b[0], camera.width)];
  const [r0, r1] = [within(a[1], camera.height), within(b[1], camera.height)];
  return { column: Math.min(c0, c1), row: Math.min(r0, r1), width: Math.abs(c1 - c0) + 1, height: Math.abs(r1 - r0) + 1 };
}

export const regionText = ({ column, row, width, height }: Region): string => `${column},${row},${width},${height}`;

/** COLUMN,ROW,WIDTH,HEIGHT; null where it is not that, or not within the picture. */
export function parseRegion(text: string, camera: Size): Region | null {
  const match = /^\s*(\d{1,5})\s*,\s*(\d{1,5})\s*,\s*(\d{1,5})\s*,\s*(\d{1,5})\s*$/.exec(text);
  if (match === null) return null;
  const [column, row, width, height] = match.slice(1).map(Number) as [number, number, number, number];
  const isWithin = width > 0 && height > 0 && column + width <= camera.width && row + height <= camera.height;
  return isWithin ? { column, row, width, height } : null;
}

/** Column, row and 1/z a vertex; 1/z is 0 where it is behind the camera. */
export function seenBy(lens: Lens, positions: Float32Array): Float64Array {
  const kNearest = 1e-6; // metres
  const seen = new Float64Array(positions.length);
  for (let i = 0; i < positions.length; i += 3) {
    const z = positions[i + 2]!;
    if (!(z > kNearest)) continue;
    const [column, row] = pixelOf(lens, positions[i]! / z, positions[i + 1]! / z);
    seen[i] = column;
    seen[i + 1] = row;
    seen[i + 2] = 1 / z;
  }
  return seen;
}

/**
 * z at the middle of each pixel of the region, of the nearest triangle; infinite where there is none. Triangles are straight
 * in the picture, those with a corner behind the camera are left out. `seen`: by seenBy().
 */
export function depthsIn(region: Region, seen: Float64Array, triangles: Uint32Array): Float64Array {
  const { width } = region;
  const [lastColumn, lastRow] = [region.column + width - 1, region.row + region.height - 1];
  const depths = new Float64Array(width * region.height).fill(Infinity);
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [3 * triangles[t]!, 3 * triangles[t + 1]!, 3 * triangles[t + 2]!];
    const [az, bz, cz] = [seen[a + 2]!, seen[b + 2]!, seen[c + 2]!]; // inverse: linear in a pinhole's picture
    if (!(az > 0 && bz > 0 && cz > 0)) continue;
    const [ax, ay, bx, by, cx, cy] = [seen[a]!, seen[a + 1]!, seen[b]!, seen[b + 1]!, seen[c]!, seen[c + 1]!];
    const area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay);
    if (area === 0 || !Number.isFinite(area)) continue;
    const [firstRow, endRow] = [Math.max(region.row, Math.ceil(Math.min(ay, by, cy))), Math.min(lastRow, Math.floor(Math.max(ay, by, cy)))];
    const [first, end] = [Math.max(region.column, Math.ceil(Math.min(ax, bx, cx))), Math.min(lastColumn, Math.floor(Math.max(ax, bx, cx)))];
    for (let row = firstRow; row <= endRow; ++row) {
      for (let column = first; column <= end; ++column) {
        const wb = ((column - ax) * (cy - ay) - (cx - ax) * (row - ay)) / area;
        const wc = ((bx - ax) * (row - ay) - (column - ax) * (by - ay)) / area;
        if (wb < 0 || wc < 0 || wb + wc > 1) continue;
        const at = (row - region.row) * width + column - region.column;
        depths[at] = Math.min(depths[at]!, 1 / (az + wb * (bz - az) + wc * (cz - az)));
      }
    }
  }
  return depths;
}
