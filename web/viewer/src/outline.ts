// SPDX-License-Identifier: Apache-2.0
// Where a flat face ends before something farther, as its mesh tells: at the last stripe and line that were decoded, inside
// of where the face does. Pure.
// Rays are (x/z, y/z), as a pinhole without a lens's distortion sees them.
import type { Face } from './faces';
import { indicesOf, type Patch } from './patch';

/** A straight piece of a rim: normal · ray = offset, for rays `from` to `to` along it. */
export interface Rim {
  readonly normal: readonly [number, number]; // unit, away from the face
  readonly offset: number;
  readonly from: number; // of (-normal[1], normal[0]) · ray
  readonly to: number;
  readonly step: number; // of the mesh, across the rim
  readonly lack: number; // from the mesh's own rim to this
  readonly mesh: readonly Outer[]; // what of the mesh lies at it
  readonly source: 'mesh' | 'picture';
  /** Of the offset, there along it. */
  variance(along: number): number;
}

/** A vertex at a rim: where along it, and how far out. */
export interface Outer {
  readonly along: number;
  readonly out: number;
}

const kRims = 6; // of a face
const kTries = 100;
const kFresh = 3; // vertices at a rim that are at no other
const kBehind = 1.4; // steps: how far the mesh's own rim is behind its outermost vertices
const kOutermost = 0.6; // what is no farther behind is at no other rim
const kBefore = 0.4;
const kBeyond = 0.003; // of the members, at most, beyond a rim
const kAtBorder = 1.6; // steps from where the patch ends: there the face goes on
const kLong = 1; // at least, where 2.5 stripes or 6 lines are 1

/** Of the mesh: lines that no member lies beyond and many of the outermost lie at. */
export function meshRims(patch: Patch, face: Face): Rim[] {
  const outer = outermost(patch, face);
  const { u, v } = patch;
  const { step } = face;
  const inside = indicesOf(face.members);
  const mean = [u, v].map((of) => inside.reduce((sum, i) => sum + of[i]!, 0) / inside.length) as [number, number];
  const few = Math.max(3, kBeyond * inside.length);
  const stride = Math.max(1, Math.floor(inside.length / 3000));
  const rims: Rim[] = [];
  const taken = new Set<number>();
  let state = outer.length + 1;
  const random = (below: number): number => Math.floor(((state = (state * 48271) % 2147483647) / 2147483647) * below);
  while (rims.length < kRims) {
    const fresh = outer.filter((k) => !taken.has(k));
    if (fresh.length < kFresh) break;
    let best: { normal: [number, number]; at: number[]; news: number; over(k: number): number } | null = null;
    for (let tries = 0; tries < kTries; ++tries) {
      const others = tries % 2 === 0 ? fresh : outer;
      const [i, j] = [fresh[random(fresh.length)]!, others[random(others.length)]!];
      // In steps of the mesh, in which its rims are stairs of one.
      const [x, y] = [(u[j]! - u[i]!) / step.u, (v[j]! - v[i]!) / step.v];
      const length = Math.hypot(x, y);
      if (!(Math.abs(x) / 2.5 + Math.abs(y) / 6 > kLong)) continue;
      const normal: [number, number] = [-y / length, x / length];
      let way = 1;
      const over = (k: number): number => (way * (normal[0] * (u[k]! - u[i]!))) / step.u + (way * (normal[1] * (v[k]! - v[i]!))) / step.v;
      if ((normal[0] * (mean[0] - u[i]!)) / step.u + (normal[1] * (mean[1] - v[i]!)) / step.v > 0) way = -1;
      const at = outer.filter((k) => over(k) > -kBehind && over(k) < kBefore);
      const news = at.filter((k) => !taken.has(k)).length;
      if (news < Math.max(kFresh, at.length / 3) || (best !== null && news <= best.news)) continue;
      let beyond = 0;
      for (let n = 0; n < inside.length && beyond * stride <= few; n += stride) if (over(inside[n]!) > kBefore) ++beyond;
      if (beyond * stride <= few) best = { normal: [way * normal[0], way * normal[1]], at, news, over };
    }
    if (best === null) break;
    const rim = rimOf(patch, face, best.normal, best.at);
    for (const k of best.at) if (best.over(k) > -kOutermost) taken.add(k);
    if (rim !== null) rims.push(rim);
  }
  return rims;
}

function rimOf({ u, v }: Patch, { step }: Face, inSteps: [number, number], at: number[]): Rim | null {
  const size = Math.hypot(inSteps[0] / step.u, inSteps[1] / step.v);
  const normal: [number, number] = [inSteps[0] / step.u / size, inSteps[1] / step.v / size];
  const mesh = at.map((k): Outer => ({ along: -normal[1] * u[k]! + normal[0] * v[k]!, out: normal[0] * u[k]! + normal[1] * v[k]! }));
  const along = mesh.map((m) => m.along).sort((a, b) => a - b);
  const out = mesh.map((m) => m.out).sort((a, b) => a - b);
  const [from, to] = [along[Math.floor(0.03 * along.length)]!, along[Math.ceil(0.97 * along.length) - 1]!];
  const enough = (Math.abs(normal[1]) * (to - from)) / step.u / 2.5 + (Math.abs(normal[0]) * (to - from)) / step.v / 6;
  if (!(enough > kLong)) return null;
  const across = Math.abs(normal[0]) * step.u + Math.abs(normal[1]) * step.v;
  // It ends between its last stripe or line and the next, which was not found.
  const offset = out[Math.floor(0.9 * out.length)]! + across / 2;
  const [middle, half] = [(from + to) / 2, (to - from) / 2];
  const variance = (along: number): number => ((across * across) / 12) * (1 + 3 * ((along - middle) / half) ** 2); // either end for itself
  return { normal, offset, from, to, step: across, lack: across / 2, mesh, source: 'mesh', variance };
}

/** The outermost vertices of each line and of each stripe's width, where the patch does not just end. */
function outermost({ u, v, centre, reach }: Patch, { members, step }: Face): number[] {
  const found = new Set<number>();
  const ends = (across: Float64Array, along: Float64Array, width: number): void => {
    const rows = new Map<number, { least: number; most: number }>();
    for (let i = 0; i < members.length; ++i) {
      if (members[i] !== 1) continue;
      const key = Math.round(across[i]! / width);
      const row = rows.get(key);
      if (row === undefined) rows.set(key, { least: i, most: i });
      else if (along[i]! < along[row.least]!) row.least = i;
      else if (along[i]! > along[row.most]!) row.most = i;
    }
    for (const { least, most } of rows.values()) found.add(least).add(most);
  };
  ends(v, u, step.v);
  ends(u, v, step.u);
  return [...found].filter(
    (i) =>
      Math.abs(u[i]! - centre[0]) < reach - kAtBorder * step.u && Math.abs(v[i]! - centre[1]) < reach - kAtBorder * step.v,
  );
}
