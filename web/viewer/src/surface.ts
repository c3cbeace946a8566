// SPDX-License-Identifier: Apache-2.0
// What the worker derives from a decoded mesh: normals for shading, edges for the wireframe, and a box for the
// first view. Pure.

/**
 * Vertex normals for shading, unit, of triangles counter-clockwise seen from outside: area-weighted, then averaged
 * with their neighbours `rings` times. Lines of the camera are measured one by one and lie much closer than stripes, so
 * without averaging their noise hides the relief. Positions stay as they are.
 */
export function vertexNormals(
  positions: Float32Array,
  triangles: Uint32Array,
  rings = 3,
): Float32Array<ArrayBuffer> {
  let normals = faceSums(positions, triangles);
  normalise(normals);
  for (let ring = 0; ring < rings; ++ring) {
    const sums = new Float32Array(normals); // each counts itself once, and each neighbour once a triangle
    for (let t = 0; t < triangles.length; t += 3) {
      const a = triangles[t]! * 3;
      const b = triangles[t + 1]! * 3;
      const c = triangles[t + 2]! * 3;
      for (let i = 0; i < 3; ++i) {
        const sum = normals[a + i]! + normals[b + i]! + normals[c + i]!;
        sums[a + i] = sums[a + i]! + sum;
        sums[b + i] = sums[b + i]! + sum;
        sums[c + i] = sums[c + i]! + sum;
      }
    }
    normalise(sums);
    normals = sums;
  }
  return normals;
}

function faceSums(positions: Float32Array, triangles: Uint32Array): Float32Array<ArrayBuffer> {
  const p = positions;
  const normals = new Float32Array(p.length);
  for (let t = 0; t < triangles.length; t += 3) {
    const a = triangles[t]! * 3;
    const b = triangles[t + 1]! * 3;
    const c = triangles[t + 2]! * 3;
    const ux = p[b]! - p[a]!;
    const uy = p[b + 1]! - p[a + 1]!;
    const uz = p[b + 2]! - p[a + 2]!;
    const vx = p[c]! - p[a]!;
    const vy = p[c + 1]! - p[a + 1]!;
    const vz = p[c + 2]! - p[a + 2]!;
    const nx = uy * vz - uz * vy;
    const ny = uz * vx - ux * vz;
    const nz = ux * vy - uy * vx;
    for (const v of [a, b, c]) {
      normals[v] = normals[v]! + nx;
      normals[v + 1] = normals[v + 1]! + ny;
      normals[v + 2] = normals[v + 2]! + nz;
    }
  }
  return normals;
}

function normalise(normals: Float32Array): void {
  for (let v = 0; v < normals.length; v += 3) {
    const length = Math.hypot(normals[v]!, normals[v + 1]!, normals[v + 2]!);
    const scale = length > 0 ? 1 / length : 0;
    normals[v] = normals[v]! * scale;
    normals[v + 1] = normals[v + 1]! * scale;
    normals[v + 2] = length > 0 ? normals[v + 2]! * scale : -1; // towards the camera
  }
}

/** Two vertex indices an edge; an edge of two triangles comes twice, which a line drawing does not show. */
export function triangleEdges(triangles: Uint32Array): Uint32Array<ArrayBuffer> {
  const edges = new Uint32Array(triangles.length * 2);
  for (let t = 0, e = 0; t < triangles.length; t += 3, e += 6) {
    const a = triangles[t]!;
    const b = triangles[t + 1]!;
    const c = triangles[t + 2]!;
    edges[e] = a;
    edges[e + 1] = b;
    edges[e + 2] = b;
    edges[e + 3] = c;
    edges[e + 4] = c;
    edges[e + 5] = a;
  }
  return edges;
}

export interface Box {
  min: [number, number, number];
  max: [number, number, number];
}

export interface Extent extends Box {
  centre: [number, number, number]; // medians
  /** Near and far, of nearly all: who stands at the picture's side is in it. */
  depths: readonly [number, number];
  /** Of what stands apart before the rest, as a person before a wall; without it: nothing does. */
  subject?: Box;
}

const kOutside = 0.02; // of all, on either side of the box
const kStray = 0.003; // of all, before or behind the depths
const kBins = 32; // of depth
const kEmpty = 0.003; // of all, in a bin at most: what flies between two surfaces does not join them
const kApart = 5; // empty bins
const kSubject = 0.08; // of all, at least

/** Robust box: what lies outside of it, 2 % on either side, does not move the first view. Nothing below 50 vertices. */
export function robustExtent(positions: Float32Array): Extent | null {
  const vertices = positions.length / 3;
  if (vertices < 50) return null;
  const step = Math.max(1, Math.floor(vertices / 2000));
  const some = Array.from({ length: 3 }, () => new Float32Array(Math.ceil(vertices / step)));
  for (let i = 0; i < some[0]!.length; ++i) {
    for (let axis = 0; axis < 3; ++axis) some[axis]![i] = positions[i * step * 3 + axis]!;
  }
  const { box, medians, depths } = boxOf(some);
  const before = gapOf(some[2]!, box.min[2], box.max[2]);
  if (before === null) return { ...box, centre: medians, depths };
  const isNear = some[2]!.map((z) => (z < before ? 1 : 0));
  const subject = boxOf(some.map((values) => values.filter((_, i) => isNear[i] === 1))).box;
  return { ...box, centre: medians, depths, subject };
}

function boxOf(axes: Float32Array[]): { box: Box; medians: [number, number, number]; depths: [number, number] } {
  const at = (fraction: number): [number, number, number] =>
    axes.map((values) => values[Math.floor(fraction * (values.length - 1))]!) as [number, number, number];
  axes = axes.map((values) => values.slice().sort()); // by number, without a call for each pair
  return { box: { min: at(kOutside), max: at(1 - kOutside) }, medians: at(0.5), depths: [at(kStray)[2], at(1 - kStray)[2]] };
}

/** A depth between what stands apart and the rest; null: there is no such. */
function gapOf(depths: Float32Array, from: number, to: number): number | null {
  if (!(to > from)) return null;
  const bins = new Uint32Array(kBins);
  for (const z of depths) {
    const bin = Math.floor(((z - from) / (to - from)) * kBins);
    if (bin >= 0 && bin < kBins) bins[bin] = bins[bin]! + 1;
  }
  let [before, empty, best, end] = [0, 0, 0, 0];
  for (let bin = 0; bin < kBins; ++bin) {
    before += bins[bin]!;
    empty = bins[bin]! <= kEmpty * depths.length ? empty + 1 : 0;
    if (empty > best && before >= kSubject * depths.length) [best, end] = [empty, bin + 1];
  }
  return best < kApart ? null : from + ((end - best / 2) / kBins) * (to - from);
}
