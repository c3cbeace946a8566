// SPDX-License-Identifier: Apache-2.0
// The flat faces of a patch of a surface: planes that most of what is around lies in, to within how exactly it was
// measured. What is curved has none. Pure, and the same for the same patch.
import { indicesOf, inverseColumns, median, stepOf, type Patch, type Step } from './patch';
import type { Vec3 } from './pick';

export interface Face {
  /** p · X = 1 for its places X in the camera's frame: 1/z = p · (x/z, y/z, 1). */
  readonly plane: Vec3;
  /** Of p, by the columns. */
  readonly covariance: readonly [Vec3, Vec3, Vec3];
  readonly members: Uint8Array; // 1: a vertex of the patch that is on it, in one piece with the others
  readonly fits: Uint8Array; // the same, in any piece
  readonly step: Step;
  readonly scatter: number; // of its members' errors, in their standard deviations
}

const kMost = 5; // faces of a patch
const kTries = 80;
const kScored = 700; // vertices, to compare tries by
const kFirstTolerance = 5; // standard deviations
const kTolerance = 3.5; // of the scatter that there is
const kRounds = 5;
const kMembers = 150; // at least
const kStripes = 2.8; // steps, at least that wide
const kLines = 7;
const kClose = [1.5, 2.5] as const; // stripes and lines: cells that are next to each other hang together
const kBend = 1.26; // of the scatter: less is flat
const kBent = 0.5; // of the scatter's square, that what is bent explains where the surface is
const kForBend = 1500; // vertices, that tell it
const kCells = 7; // each way, for how errors hang together

/** Beginning with those that most of the patch lies in. */
export function findFaces(patch: Patch): Face[] {
  const faces: Face[] = [];
  const free = new Uint8Array(patch.count).fill(1);
  const step = stepOf(patch, () => true);
  if (step === null) return [];
  const cells = cellsOf(patch, step);
  const random = randomFrom(patch.count);
  for (let misses = 0; faces.length < kMost && misses < 2; ) {
    const first = bestPlane(patch, free, random);
    if (first === null) break;
    const face = settle(patch, free, first, cells);
    if (face === null) {
      ++misses;
      // What was tried is not tried again.
      for (let i = 0; i < patch.count; ++i) if (offBy(patch, first, i) < kFirstTolerance) free[i] = 0;
      continue;
    }
    for (let i = 0; i < patch.count; ++i) if (face.fits[i] === 1) free[i] = 0;
    if (isFlat(patch, face)) faces.push(face);
  }
  return faces;
}

function randomFrom(seed: number): (below: number) => number {
  let state = (seed % 2147483646) + 1;
  return (below) => {
    state = (state * 48271) % 2147483647;
    return Math.floor((state / 2147483647) * below);
  };
}

/** In standard deviations. */
export function offBy({ u, v, w, sigma }: Patch, [a, b, c]: Vec3, i: number): number {
  return Math.abs(w[i]! - (a * u[i]! + b * v[i]! + c)) / sigma[i]!;
}

/** Of planes through three near vertices, that with most vertices. */
function bestPlane(patch: Patch, free: Uint8Array, random: (below: number) => number): Vec3 | null {
  const { u, v, w } = patch;
  const candidates: number[] = [];
  for (let i = 0; i < patch.count; ++i) if (free[i] === 1) candidates.push(i);
  if (candidates.length < kMembers) return null;
  const stride = Math.max(1, Math.floor(candidates.length / kScored));
  const [spreadU, spreadV] = [spread(u, candidates), spread(v, candidates)];
  const near = (i: number): number => {
    for (let tries = 0; tries < 12; ++tries) {
      const j = candidates[random(candidates.length)]!;
      if (Math.abs(u[j]! - u[i]!) < spreadU / 3 && Math.abs(v[j]! - v[i]!) < spreadV / 3) return j;
    }
    return i;
  };
  let best: Vec3 | null = null;
  let most = 0;
  for (let tries = 0; tries < kTries; ++tries) {
    const i = candidates[random(candidates.length)]!;
    const [j, k] = [near(i), near(i)];
    const columns = inverseColumns([u[i]!, v[i]!, 1], [u[j]!, v[j]!, 1], [u[k]!, v[k]!, 1]);
    if (columns === null) continue;
    const plane = [0, 1, 2].map((n) => columns[0][n]! * w[i]! + columns[1][n]! * w[j]! + columns[2][n]! * w[k]!) as Vec3;
    let count = 0;
    for (let n = 0; n < candidates.length; n += stride) if (offBy(patch, plane, candidates[n]!) < kFirstTolerance) ++count;
    if (count > most) [best, most] = [plane, count];
  }
  return best;
}

function spread(values: Float64Array, of: readonly number[]): number {
  let [least, most] = [Infinity, -Infinity];
  for (const i of of) [least, most] = [Math.min(least, values[i]!), Math.max(most, values[i]!)];
  return most - least;
}

/** Fitted to its largest piece until that stays; null where it is too small for a face. */
function settle(patch: Patch, free: Uint8Array, first: Vec3, cells: Cells): Face | null {
  let plane = first;
  let tolerance = kFirstTolerance;
  let scatter = 1;
  let fits = new Uint8Array(patch.count);
  let members = fits;
  for (let round = 0; round < kRounds; ++round) {
    fits = new Uint8Array(patch.count);
    for (let i = 0; i < patch.count; ++i) if (free[i] === 1 && offBy(patch, plane, i) < tolerance) fits[i] = 1;
    members = largestPiece(cells, fits);
    const solved = solve(patch, members);
    if (solved === null) return null;
    plane = solved;
    const off: number[] = [];
    for (let i = 0; i < patch.count; ++i) if (members[i] === 1) off.push(offBy(patch, plane, i));
    if (off.length < kMembers) return null;
    scatter = Math.max(0.7, 1.4826 * median(off));
    tolerance = kTolerance * Math.min(3, scatter);
  }
  const step = stepOf(patch, (i) => members[i] === 1);
  const inside = indicesOf(members);
  if (step === null || spread(patch.u, inside) < kStripes * step.u || spread(patch.v, inside) < kLines * step.v) return null;
  const covariance = covarianceOf(patch, members, plane);
  return covariance === null ? null : { plane, covariance, members, fits, step, scatter };
}

/** The patch in cells, which hang together where they are next to each other: at rims single vertices and their triangles are missing. */
interface Cells {
  of: Uint32Array; // of each vertex
  row: number; // by so much a cell differs from that below it; there is an empty one around all
  count: number;
}

function cellsOf({ count, u, v, centre, reach }: Patch, step: Step): Cells {
  const [wide, high] = [Math.max(kClose[0] * step.u, reach / 500), Math.max(kClose[1] * step.v, reach / 500)];
  const row = Math.ceil((2 * reach) / wide) + 3;
  const of = new Uint32Array(count);
  for (let i = 0; i < count; ++i) {
    const [column, line] = [Math.floor((u[i]! - centre[0] + reach) / wide), Math.floor((v[i]! - centre[1] + reach) / high)];
    of[i] = (line + 1) * row + column + 1;
  }
  return { of, row, count: row * (Math.ceil((2 * reach) / high) + 3) };
}

/** Of what fits, the most that hangs together. */
function largestPiece({ of, row, count }: Cells, fits: Uint8Array): Uint8Array<ArrayBuffer> {
  const sizes = new Uint32Array(count);
  for (let i = 0; i < fits.length; ++i) if (fits[i] === 1) sizes[of[i]!] = sizes[of[i]!]! + 1;
  const pieces = new Uint32Array(count);
  const around = [-row - 1, -row, -row + 1, -1, 1, row - 1, row, row + 1];
  let [largest, most, piece] = [0, 0, 0];
  for (let start = 0; start < count; ++start) {
    if (sizes[start] === 0 || pieces[start] !== 0) continue;
    pieces[start] = ++piece;
    let size = 0;
    for (const stack = [start]; stack.length > 0; ) {
      const cell = stack.pop()!;
      size += sizes[cell]!;
      for (const by of around) {
        if (sizes[cell + by] === 0 || pieces[cell + by] !== 0) continue;
        pieces[cell + by] = piece;
        stack.push(cell + by);
      }
    }
    if (size > most) [largest, most] = [piece, size];
  }
  const members = new Uint8Array(fits.length);
  for (let i = 0; i < fits.length; ++i) if (fits[i] === 1 && pieces[of[i]!] === largest) members[i] = 1;
  return members;
}

/** The weighted sums of least squares: of the squares of u, v and 1, and of them with w. */
function normalEquations({ u, v, w, sigma, count }: Patch, members: Uint8Array): { rows: [Vec3, Vec3, Vec3]; right: Vec3 } {
  let [uu, uv, u1, vv, v1, one, uw, vw, w1] = [0, 0, 0, 0, 0, 0, 0, 0, 0];
  for (let i = 0; i < count; ++i) {
    if (members[i] !== 1) continue;
    const weight = 1 / (sigma[i]! * sigma[i]!);
    const [x, y, z] = [u[i]!, v[i]!, w[i]!];
    uu += weight * x * x;
    uv += weight * x * y;
    u1 += weight * x;
    vv += weight * y * y;
    v1 += weight * y;
    one += weight;
    uw += weight * x * z;
    vw += weight * y * z;
    w1 += weight * z;
  }
  return { rows: [[uu, uv, u1], [uv, vv, v1], [u1, v1, one]], right: [uw, vw, w1] };
}

// Rows of very unlike size: the test for those in one plane is not for these.
function inverseOf([a, b, c]: readonly [Vec3, Vec3, Vec3]): [Vec3, Vec3, Vec3] | null {
  const s = [a[0], b[1], c[2]].map((x) => 1 / Math.sqrt(x)) as Vec3;
  if (!s.every(Number.isFinite)) return null;
  const evened = [a, b, c].map((row, i) => row.map((x, j) => x * s[i]! * s[j]!) as Vec3) as [Vec3, Vec3, Vec3];
  const [d, e, f] = evened;
  const minors: Vec3 = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
  const volume = d[0] * minors[0] + d[1] * minors[1] + d[2] * minors[2];
  if (!(volume > 1e-12)) return null;
  const column = (p: Vec3, q: Vec3): Vec3 => [
    (p[1] * q[2] - p[2] * q[1]) / volume,
    (p[2] * q[0] - p[0] * q[2]) / volume,
    (p[0] * q[1] - p[1] * q[0]) / volume,
  ];
  const columns = [column(e, f), column(f, d), column(d, e)];
  return columns.map((col, j) => col.map((x, i) => x * s[i]! * s[j]!) as Vec3) as [Vec3, Vec3, Vec3];
}

const times = ([a, b, c]: readonly [Vec3, Vec3, Vec3], x: Vec3): Vec3 =>
  [0, 1, 2].map((i) => a[i]! * x[0] + b[i]! * x[1] + c[i]! * x[2]) as Vec3;

function solve(patch: Patch, members: Uint8Array): Vec3 | null {
  const { rows, right } = normalEquations(patch, members);
  const columns = inverseOf(rows);
  return columns === null ? null : times(columns, right);
}

/**
 * Errors of neighbours hang together (of a stripe, of a line, of the picture's noise between), so what is left of each cell
 * of the face counts as one. Never less than independent errors would give.
 */
function covarianceOf(patch: Patch, members: Uint8Array, plane: Vec3): [Vec3, Vec3, Vec3] | null {
  const { u, v, w, sigma } = patch;
  const columns = inverseOf(normalEquations(patch, members).rows);
  if (columns === null) return null;
  const inside = indicesOf(members);
  const [[u0], [v0]] = [bounds(u, inside), bounds(v, inside)];
  const [wide, high] = [spread(u, inside) * 1.0001, spread(v, inside) * 1.0001];
  const sums = Array.from({ length: kCells * kCells }, (): Vec3 => [0, 0, 0]);
  for (const i of inside) {
    const sum = sums[Math.floor(((u[i]! - u0) / wide) * kCells) * kCells + Math.floor(((v[i]! - v0) / high) * kCells)]!;
    const left = (w[i]! - (plane[0] * u[i]! + plane[1] * v[i]! + plane[2])) / (sigma[i]! * sigma[i]!);
    sum[0] += left * u[i]!;
    sum[1] += left * v[i]!;
    sum[2] += left;
  }
  const filled = sums.filter((sum) => sum[2] !== 0).length;
  const inflated = filled / Math.max(1, filled - 3);
  const out = [0, 1, 2].map(() => [0, 0, 0]) as [Vec3, Vec3, Vec3];
  for (const sum of sums) {
    const moved = times(columns, sum);
    for (let i = 0; i < 3; ++i) for (let j = 0; j < 3; ++j) out[i]![j]! += inflated * moved[i]! * moved[j]!;
  }
  return out.map((column, i) => column.map((x, j) => x + columns[i]![j]!) as Vec3) as [Vec3, Vec3, Vec3];
}

function bounds(values: Float64Array, of: readonly number[]): [number, number] {
  let [least, most] = [Infinity, -Infinity];
  for (const i of of) [least, most] = [Math.min(least, values[i]!), Math.max(most, values[i]!)];
  return [least, most];
}

/** Whether a bent surface does not fit it much better than the plane. */
function isFlat(patch: Patch, { members, scatter, plane }: Face): boolean {
  const all = indicesOf(members);
  const stride = Math.max(1, Math.floor(all.length / kForBend));
  const inside = all.filter((_, n) => n % stride === 0);
  const { u, v, w, sigma } = patch;
  const [[u0, u1], [v0, v1]] = [bounds(u, inside), bounds(v, inside)];
  const terms = (i: number): number[] => {
    const [x, y] = [(2 * u[i]! - u0 - u1) / (u1 - u0), (2 * v[i]! - v0 - v1) / (v1 - v0)];
    return [1, x, y, x * x, x * y, y * y];
  };
  const leftOf = (i: number): number => (w[i]! - (plane[0] * u[i]! + plane[1] * v[i]! + plane[2])) / sigma[i]!;
  const rows = Array.from({ length: 6 }, () => new Float64Array(7));
  for (const i of inside) {
    const t = terms(i);
    const left = leftOf(i);
    for (let r = 0; r < 6; ++r) {
      for (let c = 0; c < 6; ++c) rows[r]![c]! += t[r]! * t[c]!;
      rows[r]![6]! += t[r]! * left;
    }
  }
  const bent = eliminate(rows);
  if (bent === null) return false;
  // What it adds to the plane, in standard deviations: a plane that cuts a bent surface is off by its tolerance both ways.
  let [least, most] = [Infinity, -Infinity];
  let [before, after] = [0, 0];
  for (const i of inside) {
    const off = terms(i).reduce((sum, term, n) => sum + term * bent[n]!, 0);
    [least, most] = [Math.min(least, off), Math.max(most, off)];
    before += leftOf(i) ** 2;
    after += (leftOf(i) - off) ** 2;
  }
  // Of a flat face of few stripes, each with an error of its own, a bent surface explains a part by chance.
  return most - least < kBend * scatter || before - after < kBent * before;
}

/** Solves by elimination; the last column is the right side. */
function eliminate(rows: Float64Array[]): number[] | null {
  const n = rows.length;
  for (let c = 0; c < n; ++c) {
    let pivot = c;
    for (let r = c + 1; r < n; ++r) if (Math.abs(rows[r]![c]!) > Math.abs(rows[pivot]![c]!)) pivot = r;
    if (!(Math.abs(rows[pivot]![c]!) > 1e-9)) return null;
    [rows[c], rows[pivot]] = [rows[pivot]!, rows[c]!];
    for (let r = 0; r < n; ++r) {
      if (r === c) continue;
      const by = rows[r]![c]! / rows[c]![c]!;
      for (let k = c; k <= n; ++k) rows[r]![k]! -= by * rows[c]![k]!;
    }
  }
  return rows.map((row, r) => row[n]! / row[r]!);
}
