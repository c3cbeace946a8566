// SPDX-License-Identifier: Apache-2.0
// Planes and spheres through measured points, some of which are of something else: as client/measure/shape, so that page
// and command say the same of the same points. Camera frame, metres. Pure.
import type { Vec3 } from './pick';

export const kShapes = ['plane', 'sphere'] as const;
export type ShapeKind = (typeof kShapes)[number];

export interface Shape {
  readonly kind: ShapeKind;
  readonly at: Vec3; // plane: its unit normal, towards the camera; sphere: its centre
  readonly size: number; // plane: how far the camera is from it; sphere: its radius
}

const kSamples = 200; // half of the points may be of something else
const kJudges = 2000;
const kRounds = 20;
const kTukey = 4.685; // 95 % as efficient as least squares where errors are normal
export const kMadToSigma = 1.4826;
const kStill = 1e-10; // metres
const kLeastTurn = 1e-12;

const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** How far a point is before the plane, or outside the sphere. */
export function heightOver({ kind, at, size }: Shape, x: number, y: number, z: number): number {
  if (kind === 'plane') return at[0] * x + at[1] * y + at[2] * z + size;
  return Math.sqrt((x - at[0]) ** 2 + (y - at[1]) ** 2 + (z - at[2]) ** 2) - size;
}

/** By how much the height changes as the point moves. */
export function normalAt({ kind, at }: Shape, [x, y, z]: Vec3): Vec3 {
  if (kind === 'plane') return at;
  const off: Vec3 = [x - at[0], y - at[1], z - at[2]];
  const length = Math.sqrt(dot(off, off));
  return [off[0] / length, off[1] / length, off[2] / length];
}

/** Of the first `count` values, which are put in another order; the upper one of an even number. */
export function medianOf(values: Float64Array, count = values.length): number {
  const middle = count >> 1;
  let [low, high] = [0, count - 1];
  while (low < high) {
    const pivot = values[(low + high) >> 1]!;
    let [i, j] = [low, high];
    while (i <= j) {
      while (values[i]! < pivot) ++i;
      while (values[j]! > pivot) --j;
      if (i > j) break;
      const value = values[i]!;
      values[i++] = values[j]!;
      values[j--] = value;
    }
    if (middle <= j) high = j;
    else if (middle >= i) low = i;
    else break;
  }
  return values[middle]!;
}

function plane(through: Vec3, normal: Vec3): Shape {
  const along = dot(normal, through);
  const at: Vec3 = along > 0 ? [-normal[0], -normal[1], -normal[2]] : normal; // the camera is at the origin
  return { kind: 'plane', at, size: Math.abs(along) };
}

/** Of n equations, a row each with its right side behind it; null where they determine nothing. */
function solve(rows: number[][]): number[] | null {
  const n = rows.length;
  const order = Array.from({ length: n }, (_, i) => i); // of the unknowns
  let largest = 0;
  for (let k = 0; k < n; ++k) {
    let [best, row, column] = [-1, k, k];
    for (let i = k; i < n; ++i) for (let j = k; j < n; ++j) if (Math.abs(rows[i]![j]!) > best) [best, row, column] = [Math.abs(rows[i]![j]!), i, j];
    largest = Math.max(largest, best);
    if (!(best > largest * n * Number.EPSILON)) return null;
    [rows[k], rows[row]] = [rows[row]!, rows[k]!];
    [order[k], order[column]] = [order[column]!, order[k]!];
    for (const r of rows) [r[k], r[column]] = [r[column]!, r[k]!];
    for (let i = k + 1; i < n; ++i) {
      const share = rows[i]![k]! / rows[k]![k]!;
      for (let j = k; j <= n; ++j) rows[i]![j]! -= share * rows[k]![j]!;
    }
  }
  const out = new Array<number>(n);
  for (let k = n - 1; k >= 0; --k) {
    let value = rows[k]![n]!;
    for (let j = k + 1; j < n; ++j) value -= rows[k]![j]! * out[order[j]!]!;
    out[order[k]!] = value / rows[k]![k]!;
  }
  return out;
}

/** Of a symmetric 3x3 matrix (xx xy xz yy yz zz) the direction of its least eigenvalue, by Jacobi's turns. */
function leastAxis([xx, xy, xz, yy, yz, zz]: readonly [number, number, number, number, number, number]): Vec3 {
  const m = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
  const axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  for (let sweep = 0; sweep < 30; ++sweep) {
    if (m[0]![1] === 0 && m[0]![2] === 0 && m[1]![2] === 0) break;
    for (const [p, q] of [[0, 1], [0, 2], [1, 2]] as const) {
      const off = m[p]![q]!;
      if (off === 0) continue;
      const theta = (m[q]![q]! - m[p]![p]!) / (2 * off);
      const t = (theta < 0 ? -1 : 1) / (Math.abs(theta) + Math.hypot(theta, 1));
      const c = 1 / Math.hypot(t, 1);
      const s = t * c;
      for (const rows of [m, axes]) {
        for (const row of rows) [row[p], row[q]] = [c * row[p]! - s * row[q]!, s * row[p]! + c * row[q]!];
      }
      for (let j = 0; j < 3; ++j) [m[p]![j], m[q]![j]] = [c * m[p]![j]! - s * m[q]![j]!, s * m[p]![j]! + c * m[q]![j]!];
      m[p]![q] = m[q]![p] = 0;
    }
  }
  const least = [0, 1, 2].reduce((best, i) => (m[i]![i]! < m[best]![best]! ? i : best));
  return [axes[0]![least]!, axes[1]![least]!, axes[2]![least]!];
}

/** Three of the points for a plane, all four for a sphere. */
function through(kind: ShapeKind, [a, b, c, d]: readonly [Vec3, Vec3, Vec3, Vec3]): Shape | null {
  const from = (p: Vec3): Vec3 => [p[0] - a[0], p[1] - a[1], p[2] - a[2]];
  const [u, v] = [from(b), from(c)];
  if (kind === 'plane') {
    const n: Vec3 = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const length = Math.sqrt(dot(n, n));
    return length > kLeastTurn ? plane(a, [n[0] / length, n[1] / length, n[2] / length]) : null;
  }
  const by = solve([u, v, from(d)].map((p) => [2 * p[0], 2 * p[1], 2 * p[2], dot(p, p)]));
  if (by === null) return null;
  const [x, y, z] = by as Vec3;
  return { kind, at: [a[0] + x, a[1] + y, a[2] + z], size: Math.sqrt(x * x + y * y + z * z) };
}

/** Of |height|, of each `step`th point. */
function medianHeight(shape: Shape, p: Float32Array, step: number, scratch: Float64Array): number {
  let count = 0;
  for (let i = 0; i < p.length; i += 3 * step) scratch[count++] = Math.abs(heightOver(shape, p[i]!, p[i + 1]!, p[i + 2]!));
  return medianOf(scratch, count);
}

function bestSample(kind: ShapeKind, p: Float32Array, scratch: Float64Array): Shape | null {
  const count = p.length / 3;
  const step = Math.max(1, Math.floor(count / kJudges));
  let random = 1; // as std::minstd_rand: the command draws the same points
  const draw = (): Vec3 => {
    random = (random * 48271) % 2147483647;
    const i = 3 * (random % count);
    return [p[i]!, p[i + 1]!, p[i + 2]!];
  };
  let [best, least]: [Shape | null, number] = [null, Infinity];
  for (let i = 0; i < kSamples; ++i) {
    const shape = through(kind, [draw(), draw(), draw(), draw()]);
    if (shape === null) continue;
    const off = medianHeight(shape, p, step, scratch);
    if (off < least) [best, least] = [shape, off];
  }
  return best;
}

/** Weighted least squares of distances: a plane's at once, of a sphere one step of Gauss-Newton. */
function improved(shape: Shape, p: Float32Array, sigma: number): Shape | null {
  return shape.kind === 'plane' ? improvedPlane(shape, p, kTukey * sigma) : improvedSphere(shape, p, kTukey * sigma);
}

function weightOf(off: number, reach: number): number {
  const share = off / reach;
  return Math.abs(share) < 1 ? (1 - share * share) ** 2 : 0;
}

function improvedPlane(shape: Shape, p: Float32Array, reach: number): Shape | null {
  const [ox, oy, oz] = [p[0]!, p[1]!, p[2]!];
  let [n, sx, sy, sz, xx, xy, xz, yy, yz, zz] = [0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
  for (let i = 0; i < p.length; i += 3) {
    const w = weightOf(heightOver(shape, p[i]!, p[i + 1]!, p[i + 2]!), reach);
    if (w === 0) continue;
    const [x, y, z] = [p[i]! - ox, p[i + 1]! - oy, p[i + 2]! - oz];
    n += w;
    sx += w * x;
    sy += w * y;
    sz += w * z;
    xx += w * x * x;
    xy += w * x * y;
    xz += w * x * z;
    yy += w * y * y;
    yz += w * y * z;
    zz += w * z * z;
  }
  if (!(n > 3)) return null;
  const [mx, my, mz] = [sx / n, sy / n, sz / n];
  const axis = leastAxis([xx / n - mx * mx, xy / n - mx * my, xz / n - mx * mz, yy / n - my * my, yz / n - my * mz, zz / n - mz * mz]);
  return plane([ox + mx, oy + my, oz + mz], axis);
}

function improvedSphere(shape: Shape, p: Float32Array, reach: number): Shape | null {
  const rows = Array.from({ length: 4 }, () => [0, 0, 0, 0, 0]);
  let weights = 0;
  for (let i = 0; i < p.length; i += 3) {
    const off = heightOver(shape, p[i]!, p[i + 1]!, p[i + 2]!);
    const w = weightOf(off, reach);
    if (w === 0) continue;
    const [x, y, z] = normalAt(shape, [p[i]!, p[i + 1]!, p[i + 2]!]);
    const change = [-x, -y, -z, -1, -off]; // of the height, by centre and radius
    weights += w;
    for (let r = 0; r < 4; ++r) for (let c = 0; c < 5; ++c) rows[r]![c]! += w * change[r]! * change[c]!;
  }
  const by = weights > 3 ? solve(rows) : null;
  if (by === null) return null;
  const [x, y, z, radius] = by as [number, number, number, number];
  return { kind: 'sphere', at: [shape.at[0] + x, shape.at[1] + y, shape.at[2] + z], size: shape.size + radius };
}

/**
 * The one that most points lie on (least median of squares over samples, then Tukey's biweight: what is more than 4.7
 * robust deviations off counts as nothing). Three coordinates a point. Null of fewer than four, or of such as determine none.
 */
export function fitShape(kind: ShapeKind, points: Float32Array): Shape | null {
  if (points.length < 12) return null;
  const scratch = new Float64Array(points.length / 3);
  let shape = bestSample(kind, points, scratch);
  for (let i = 0; shape !== null && i < kRounds; ++i) {
    const sigma = kMadToSigma * medianHeight(shape, points, 1, scratch);
    const next = improved(shape, points, Math.max(sigma, kStill));
    if (next === null) return null;
    const isStill = Math.abs(next.size - shape.size) < kStill;
    shape = next;
    if (isStill) break;
  }
  return shape;
}
