// SPDX-License-Identifier: Apache-2.0
// Rigid motions: a place of one camera's frame in another's. Pure; metres.
import type { Vec3 } from './pick';

export interface Rigid {
  readonly rotation: readonly number[]; // 3x3, row by row
  readonly translation: Vec3;
}

export const kNowhere: Rigid = { rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], translation: [0, 0, 0] };
export const toTheRight = (metres: number): Rigid => ({ ...kNowhere, translation: [metres, 0, 0] });

export function turned({ rotation: r }: Rigid, [x, y, z]: Vec3): Vec3 {
  return [r[0]! * x + r[1]! * y + r[2]! * z, r[3]! * x + r[4]! * y + r[5]! * z, r[6]! * x + r[7]! * y + r[8]! * z];
}

export function moved(by: Rigid, point: Vec3): Vec3 {
  const [x, y, z] = turned(by, point);
  const [tx, ty, tz] = by.translation;
  return [x + tx, y + ty, z + tz];
}

export function inverse({ rotation: r, translation }: Rigid): Rigid {
  const rotation = [r[0]!, r[3]!, r[6]!, r[1]!, r[4]!, r[7]!, r[2]!, r[5]!, r[8]!];
  const [x, y, z] = turned({ rotation, translation }, translation);
  return { rotation, translation: [-x, -y, -z] };
}

/** First `second`, then `first`. */
export function combined(first: Rigid, second: Rigid): Rigid {
  const columns = [0, 1, 2].map((i) => turned(first, [second.rotation[i]!, second.rotation[3 + i]!, second.rotation[6 + i]!]));
  return { rotation: [0, 1, 2].flatMap((row) => columns.map((column) => column[row]!)), translation: moved(first, second.translation) };
}

/** By a unit quaternion w, x, y, z. */
function rotationOf([w, x, y, z]: readonly number[]): number[] {
  const [a, b, c, d] = [w!, x!, y!, z!];
  return [
    a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c),
    2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b),
    2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d,
  ];
}

/** By a rotation around `axis`, as long as its angle in radians. */
export function rigidOf(axis: Vec3, translation: Vec3): Rigid {
  const angle = Math.hypot(...axis);
  const s = angle > 0 ? Math.sin(angle / 2) / angle : 0;
  return { rotation: rotationOf([Math.cos(angle / 2), ...axis.map((c) => c * s)]), translation };
}

/** What rigidOf() makes it of. */
export function axisOf({ rotation: r }: Rigid): Vec3 {
  const axis: Vec3 = [r[7]! - r[5]!, r[2]! - r[6]!, r[3]! - r[1]!]; // 2 sin(angle) long
  const [sine, cosine] = [Math.hypot(...axis) / 2, (r[0]! + r[4]! + r[8]! - 1) / 2];
  const angle = Math.atan2(sine, cosine);
  if (sine > 1e-6) return axis.map((c) => (c / (2 * sine)) * angle) as Vec3;
  if (cosine > 0) return [0, 0, 0];
  // Half a turn: the axis is what it leaves, up to its sign.
  const i = [0, 1, 2].reduce((best, at) => (r[4 * at]! > r[4 * best]! ? at : best), 0);
  const length = Math.sqrt((r[4 * i]! + 1) / 2);
  return [0, 1, 2].map((j) => (j === i ? length : (r[3 * i + j]! + r[3 * j + i]!) / (4 * length)) * Math.PI) as Vec3;
}

const kLeastSpread = 0.02; // of the places' distances, across the line that they are nearest to

/**
 * The motion that brings places onto others, least squares (Horn, 1987), and what is left, RMS. Null where there are fewer
 * than three pairs, or they lie on one line: then it is not determined.
 */
export function rigidFromPairs(pairs: readonly (readonly [from: Vec3, to: Vec3])[]): { rigid: Rigid; rms: number } | null {
  if (pairs.length < 3) return null;
  const mean = (side: 0 | 1): Vec3 =>
    [0, 1, 2].map((axis) => pairs.reduce((sum, pair) => sum + pair[side][axis]!, 0) / pairs.length) as Vec3;
  const means = [mean(0), mean(1)] as const;
  const about = pairs.map((pair) => ([0, 1] as const).map((side) => pair[side].map((c, axis) => c - means[side][axis]!) as Vec3));
  if (about.some((_, i) => i < 2 && isLine(about.map((pair) => pair[i]!)))) return null;
  const s = (a: number, b: number): number => about.reduce((sum, [from, to]) => sum + from![a]! * to![b]!, 0);
  const [xx, xy, xz, yx, yy, yz, zx, zy, zz] = [s(0, 0), s(0, 1), s(0, 2), s(1, 0), s(1, 1), s(1, 2), s(2, 0), s(2, 1), s(2, 2)];
  const rotation = rotationOf(
    largestVector([
      [xx + yy + zz, yz - zy, zx - xz, xy - yx],
      [yz - zy, xx - yy - zz, xy + yx, zx + xz],
      [zx - xz, xy + yx, yy - xx - zz, yz + zy],
      [xy - yx, zx + xz, yz + zy, zz - xx - yy],
    ]),
  );
  const back = turned({ rotation, translation: [0, 0, 0] }, means[0]);
  const rigid: Rigid = { rotation, translation: means[1].map((c, axis) => c - back[axis]!) as Vec3 };
  const left = pairs.reduce((sum, [from, to]) => sum + moved(rigid, from).reduce((d, c, axis) => d + (c - to[axis]!) ** 2, 0), 0);
  return { rigid, rms: Math.sqrt(left / pairs.length) };
}

/** Whether points about their mean lie nearly on one line. */
function isLine(points: Vec3[]): boolean {
  const sum = (a: number, b: number): number => points.reduce((all, p) => all + p[a]! * p[b]!, 0);
  const [xx, yy, zz, xy, xz, yz] = [sum(0, 0), sum(1, 1), sum(2, 2), sum(0, 1), sum(0, 2), sum(1, 2)];
  const all = xx + yy + zz;
  const minors = xx * yy - xy * xy + (xx * zz - xz * xz) + (yy * zz - yz * yz); // of the first two axes, about their product
  return !(minors > kLeastSpread ** 2 * all * all);
}

/** The eigenvector of a symmetric 4x4 matrix's largest eigenvalue, of length 1 (Jacobi). */
function largestVector(a: number[][]): number[] {
  const v = [0, 1, 2, 3].map((i) => [0, 1, 2, 3].map((j) => (i === j ? 1 : 0)));
  for (let sweep = 0; sweep < 20; ++sweep) {
    for (let p = 0; p < 3; ++p) {
      for (let q = p + 1; q < 4; ++q) {
        if (Math.abs(a[p]![q]!) < 1e-300) continue;
        const angle = Math.atan2(2 * a[p]![q]!, a[q]![q]! - a[p]![p]!) / 2;
        const [c, s] = [Math.cos(angle), Math.sin(angle)];
        for (const m of [a, v]) {
          for (const row of m) [row[p], row[q]] = [c * row[p]! - s * row[q]!, s * row[p]! + c * row[q]!];
        }
        for (let k = 0; k < 4; ++k) [a[p]![k], a[q]![k]] = [c * a[p]![k]! - s * a[q]![k]!, s * a[p]![k]! + c * a[q]![k]!];
      }
    }
  }
  const best = [0, 1, 2, 3].reduce((at, i) => (a[i]![i]! > a[at]![at]! ? i : at), 0);
  return v.map((row) => row[best]!);
}
