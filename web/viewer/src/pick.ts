// SPDX-License-Identifier: Apache-2.0
// What of a surface a ray meets first, and how exactly that place is known. Pure.
import type { VertexQuality } from './quality';

export type Vec3 = [number, number, number];

export interface Surface {
  positions: Float32Array;
  coordinates: Float32Array | null;
  colours?: Float32Array | null; // linear RGB a vertex, of files without a picture
  triangles: Uint32Array; // empty: a point cloud
  quality: VertexQuality | null;
}

export interface Picked {
  point: Vec3; // in the frame of the positions
  vertices: number[]; // three of a triangle, one of a cloud
  weights: number[]; // of the vertices; they add up to 1
  along: number; // the ray, in lengths of its direction
}

/** The nearest triangle in front of `origin`; of a point cloud the nearest point within `slack` of the ray (tangent). */
export function pick(surface: Surface, origin: Vec3, direction: Vec3, slack = 0.004): Picked | null {
  return surface.triangles.length > 0
    ? pickTriangle(surface, origin, direction)
    : pickPoint(surface.positions, origin, direction, slack);
}

// Möller and Trumbore; from both sides.
function pickTriangle({ positions: p, triangles }: Surface, origin: Vec3, direction: Vec3): Picked | null {
  const [ox, oy, oz] = origin;
  const [dx, dy, dz] = direction;
  let best = Infinity;
  let [at, bestU, bestV] = [-1, 0, 0];
  for (let t = 0; t < triangles.length; t += 3) {
    const a = triangles[t]! * 3;
    const b = triangles[t + 1]! * 3;
    const c = triangles[t + 2]! * 3;
    const [ax, ay, az] = [p[a]!, p[a + 1]!, p[a + 2]!];
    const ux = p[b]! - ax;
    const uy = p[b + 1]! - ay;
    const uz = p[b + 2]! - az;
    const vx = p[c]! - ax;
    const vy = p[c + 1]! - ay;
    const vz = p[c + 2]! - az;
    const hx = dy * vz - dz * vy;
    const hy = dz * vx - dx * vz;
    const hz = dx * vy - dy * vx;
    const det = ux * hx + uy * hy + uz * hz;
    if (det === 0) continue;
    const [sx, sy, sz] = [ox - ax, oy - ay, oz - az];
    const u = (sx * hx + sy * hy + sz * hz) / det;
    if (!(u >= 0 && u <= 1)) continue;
    const qx = sy * uz - sz * uy;
    const qy = sz * ux - sx * uz;
    const qz = sx * uy - sy * ux;
    const v = (dx * qx + dy * qy + dz * qz) / det;
    if (!(v >= 0 && u + v <= 1)) continue;
    const along = (vx * qx + vy * qy + vz * qz) / det;
    if (along > 0 && along < best) [best, at, bestU, bestV] = [along, t, u, v];
  }
  if (at < 0) return null;
  return {
    point: [ox + best * dx, oy + best * dy, oz + best * dz],
    vertices: [triangles[at]!, triangles[at + 1]!, triangles[at + 2]!],
    weights: [1 - bestU - bestV, bestU, bestV],
    along: best,
  };
}

function pickPoint(p: Float32Array, origin: Vec3, direction: Vec3, slack: number): Picked | null {
  const size2 = direction[0] ** 2 + direction[1] ** 2 + direction[2] ** 2;
  let [best, at, bestAlong] = [Infinity, -1, 0];
  for (let v = 0; v < p.length; v += 3) {
    const [x, y, z] = [p[v]! - origin[0], p[v + 1]! - origin[1], p[v + 2]! - origin[2]];
    const along = (x * direction[0] + y * direction[1] + z * direction[2]) / size2;
    if (!(along > 0)) continue;
    const off2 = x * x + y * y + z * z - along * along * size2;
    const limit = along * along * size2 * slack * slack;
    // Of those near the ray the first, not the one nearest to it: what lies behind is not meant.
    if (off2 <= limit && along < best) [best, at, bestAlong] = [along, v, along];
  }
  if (at < 0) return null;
  return { point: [p[at]!, p[at + 1]!, p[at + 2]!], vertices: [at / 3], weights: [1], along: bestAlong };
}

/** Standard deviation of the depth there, metres; null where it is not known. The vertices' errors are independent. */
export function sigmaAt({ quality }: Surface, { vertices, weights }: Picked): number | null {
  if (quality === null) return null;
  let variance = 0;
  for (const [i, v] of vertices.entries()) {
    const sigma = quality.sigmas[v] ?? 0;
    if (sigma === 0 && weights[i]! > 1e-6) return null;
    variance += (weights[i]! * sigma) ** 2;
  }
  return Math.sqrt(variance);
}

/** Where in the picture, 0..1 from its upper left corner. */
export function coordinatesAt({ coordinates }: Surface, { vertices, weights }: Picked): [number, number] | null {
  if (coordinates === null) return null;
  const sum = (offset: number): number =>
    vertices.reduce((total, v, i) => total + coordinates[2 * v + offset]! * weights[i]!, 0);
  return [sum(0), sum(1)];
}
