// SPDX-License-Identifier: Apache-2.0
// What of a surface lies around a place, as its camera measured it: rays, and inverse depths, in which planes are linear
// and whose errors are those of depth alone. Pure.
import type { Surface, Vec3 } from './pick';

export interface Patch {
  readonly count: number;
  readonly centre: readonly [number, number]; // rays within `reach` of it each way are in it
  readonly reach: number;
  readonly u: Float64Array; // x/z and y/z: the ray
  readonly v: Float64Array;
  readonly w: Float64Array; // 1/z
  readonly sigma: Float64Array; // standard deviation of w
  readonly triangles: Uint32Array; // of the patch's vertices
}

const kUnknown = 2e-4; // of the depth: its deviation where the surface does not say it
const kLeast = 5e-5; // and at least: a vertex knows nothing of what its neighbours share

const kVertices = 12_000; // of a patch, about, at most: a fine mesh needs no wider one

/** Those seen from the camera within `reach` (tangent) of the ray u, v each way, or nearer where these are too many. */
export function patchAround(surface: Surface, [u, v]: readonly [number, number], reach: number): Patch {
  const { positions: p, quality } = surface;
  const place = new Int32Array(p.length / 3).fill(-1);
  let chosen: number[] = [];
  for (let i = 0; i < place.length; ++i) {
    const z = p[3 * i + 2]!;
    if (z > 0 && Math.abs(p[3 * i]! - u * z) <= reach * z && Math.abs(p[3 * i + 1]! - v * z) <= reach * z) chosen.push(i);
  }
  if (chosen.length > kVertices) {
    reach *= Math.sqrt(kVertices / chosen.length);
    chosen = chosen.filter((i) => Math.max(Math.abs(p[3 * i]! - u * p[3 * i + 2]!), Math.abs(p[3 * i + 1]! - v * p[3 * i + 2]!)) <= reach * p[3 * i + 2]!);
  }
  for (const [at, i] of chosen.entries()) place[i] = at;
  const count = chosen.length;
  const [us, vs, ws, sigma] = [new Float64Array(count), new Float64Array(count), new Float64Array(count), new Float64Array(count)];
  for (const [at, i] of chosen.entries()) {
    const z = p[3 * i + 2]!;
    us[at] = p[3 * i]! / z;
    vs[at] = p[3 * i + 1]! / z;
    ws[at] = 1 / z;
    const known = quality?.sigmas[i] ?? 0;
    sigma[at] = Math.max(known > 0 ? known : kUnknown * z, kLeast * z) / (z * z);
  }
  return { count, centre: [u, v], reach, u: us, v: vs, w: ws, sigma, triangles: trianglesOf(surface.triangles, place) };
}

function trianglesOf(all: Uint32Array, place: Int32Array): Uint32Array {
  const isWithin = (t: number): boolean => place[all[t]!]! >= 0 && place[all[t + 1]!]! >= 0 && place[all[t + 2]!]! >= 0;
  let count = 0;
  for (let t = 0; t < all.length; t += 3) if (isWithin(t)) count += 3;
  const within = new Uint32Array(count);
  for (let t = 0, at = 0; at < count; t += 3) {
    if (!isWithin(t)) continue;
    for (let k = 0; k < 3; ++k) within[at++] = place[all[t + k]!]!;
  }
  return within;
}

/** Of a mesh: how far apart its vertices are, from stripe to stripe and from line to line; medians. */
export interface Step {
  readonly u: number;
  readonly v: number;
}

const kSampled = 1000; // numbers are enough for a median

/** `of`: whether a vertex counts. Null: there are no triangles of such. */
export function stepOf({ u, v, triangles }: Patch, of: (i: number) => boolean): Step | null {
  const [across, down]: [number[], number[]] = [[], []];
  const stride = 3 * Math.max(1, Math.floor(triangles.length / 3 / (4 * kSampled)));
  for (let t = 0; t + 2 < triangles.length; t += stride) {
    const [a, b, c] = [triangles[t]!, triangles[t + 1]!, triangles[t + 2]!];
    if (!of(a) || !of(b) || !of(c)) continue;
    across.push(Math.max(u[a]!, u[b]!, u[c]!) - Math.min(u[a]!, u[b]!, u[c]!));
    down.push(Math.max(v[a]!, v[b]!, v[c]!) - Math.min(v[a]!, v[b]!, v[c]!));
  }
  return across.length === 0 ? null : { u: median(across), v: median(down) };
}

export function median(values: readonly number[]): number {
  const stride = Math.max(1, Math.floor(values.length / kSampled));
  const sorted = Float64Array.from({ length: Math.ceil(values.length / stride) }, (_, i) => values[i * stride]!).sort();
  return sorted[sorted.length >> 1] ?? NaN;
}

/** Where this is 1. */
export function indicesOf(members: Uint8Array): number[] {
  const out: number[] = [];
  for (let i = 0; i < members.length; ++i) if (members[i] === 1) out.push(i);
  return out;
}

export const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: Vec3, b: Vec3): Vec3 => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
export const scaled = (a: Vec3, by: number): Vec3 => [a[0] * by, a[1] * by, a[2] * by];

/** The inverse of the matrix with these rows, as columns; null where they nearly lie in one plane. */
export function inverseColumns(a: Vec3, b: Vec3, c: Vec3): [Vec3, Vec3, Vec3] | null {
  const [bc, ca, ab] = [cross(b, c), cross(c, a), cross(a, b)];
  const volume = dot(a, bc);
  const size = Math.sqrt(dot(a, a) * dot(b, b) * dot(c, c));
  return Math.abs(volume) > 1e-4 * size ? [scaled(bc, 1 / volume), scaled(ca, 1 / volume), scaled(ab, 1 / volume)] : null;
}
