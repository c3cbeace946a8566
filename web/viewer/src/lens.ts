// SPDX-License-Identifier: Apache-2.0
// The Brown-Conrady lens model and its inverse, as base/lens.h. Pure.

export interface Lens {
  width: number;
  height: number;
  fx: number;
  skew: number;
  cx: number;
  fy: number;
  cy: number;
  distortion: [number, number, number, number, number]; // k1 k2 p1 p2 k3
}

export const distorts = (lens: Lens): boolean => lens.distortion.some((k) => k !== 0);

interface Distorted {
  x: number;
  y: number;
  xx: number; // derivatives by the undistorted coordinates
  xy: number;
  yx: number;
  yy: number;
}

function distort(k: Lens['distortion'], x: number, y: number): Distorted {
  const r2 = x * x + y * y;
  const radial = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  const slope = k[0] + r2 * (2 * k[1] + r2 * 3 * k[4]);
  const cross = 2 * x * y * slope + 2 * k[2] * x + 2 * k[3] * y;
  return {
    x: x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x),
    y: y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y,
    xx: radial + 2 * x * x * slope + 2 * k[2] * y + 6 * k[3] * x,
    xy: cross,
    yx: cross,
    yy: radial + 2 * y * y * slope + 6 * k[2] * y + 2 * k[3] * x,
  };
}

/** Whether the model does not fold over on the way there from the centre. */
function imaged(k: Lens['distortion'], x: number, y: number): boolean {
  for (let i = 1; i <= 8; ++i) {
    const d = distort(k, (x * i) / 8, (y * i) / 8);
    if (!(d.xx * d.yy - d.xy * d.yx > 1e-3)) return false;
  }
  return true;
}

/** x/z and y/z of a distorted pixel; null where the model has no inverse there. */
export function undistort(lens: Lens, column: number, row: number): [number, number] | null {
  const ty = (row - lens.cy) / lens.fy;
  const tx = (column - lens.cx - lens.skew * ty) / lens.fx;
  let x = tx;
  let y = ty;
  for (let i = 0; i < 30; ++i) {
    const d = distort(lens.distortion, x, y);
    const det = d.xx * d.yy - d.xy * d.yx;
    if (!(det > 1e-3)) return null;
    const ex = d.x - tx;
    const ey = d.y - ty;
    const sx = (d.yy * ex - d.xy * ey) / det;
    const sy = (d.xx * ey - d.yx * ex) / det;
    x -= sx;
    y -= sy;
    if (Math.abs(sx) + Math.abs(sy) < 1e-12) return imaged(lens.distortion, x, y) ? [x, y] : null;
  }
  return null;
}

/** The distorted pixel of x/z and y/z. */
export function pixelOf({ fx, skew, cx, fy, cy, distortion }: Lens, x: number, y: number): [column: number, row: number] {
  const d = distort(distortion, x, y);
  return [fx * d.x + skew * d.y + cx, fy * d.y + cy];
}

/** x/z at which the light sheet through a distorted, normalised column crosses height y/z = y; NaN where there is none. */
export function sheetAt(k: Lens['distortion'], column: number, y: number): number {
  let x = column;
  for (let i = 0; i < 20; ++i) {
    const d = distort(k, x, y);
    if (!(d.xx > 0.05)) return NaN;
    const step = (d.x - column) / d.xx;
    x -= step;
    if (Math.abs(step) < 1e-12) break;
  }
  return imaged(k, x, y) ? x : NaN;
}

/** Where a pinhole without the lens's distortion would have to see a point for its picture to be the same. */
export function distortPoint(lens: Lens, [x, y, z]: [number, number, number]): [number, number, number] {
  if (!distorts(lens)) return [x, y, z];
  const d = distort(lens.distortion, x / z, y / z);
  return [d.x * z, d.y * z, z];
}
