// SPDX-License-Identifier: Apache-2.0
// Edges and corners of a surface near a place that a person points at, from the flat faces that meet there or end there:
// exact where a click is not, and where the mesh ends too early. Pure; metres, the frame of the surface's own camera.
import { findFaces, type Face } from './faces';
import { hides, type Situation } from './hidden';
import { meshRims, type Rim } from './outline';
import { pictureRim, type Crop } from './pictureRim';
import { cross, dot, inverseColumns, patchAround, scaled, type Patch } from './patch';
import type { Surface, Vec3 } from './pick';

export interface Snapped {
  readonly kind: 'edge' | 'corner';
  readonly point: Vec3;
  /** Independent errors of the point, each of one standard deviation. */
  readonly errors: readonly Vec3[];
  /** Of an edge: a piece of it around the point. */
  readonly line: readonly [Vec3, Vec3] | null;
}

export interface Pointer {
  /** In pixels of the page. */
  readonly at: { readonly x: number; readonly y: number };
  readonly origin: Vec3; // of the ray there
  readonly direction: Vec3;
  readonly slack: number; // pixels of the page within which an edge or corner is meant
  toPage(point: Vec3): { x: number; y: number } | null;
}

/** Of the surface, from its own camera's eye; `crop`: of its picture, for rays within `reach` of a ray; null: there is none. */
export interface Seen extends Situation {
  crop(centre: readonly [number, number], reach: number): Crop | null;
}

const kReach = 0.2; // of the picture's width: how far around faces are looked for
const kReachUnknown = 0.07; // tangent, without a camera
const kRough = 2; // times the slack, for what only the mesh has told
const kSharp = 0.25; // radians between faces, at least
const kNear: readonly [number, number] = [2.6, 6]; // stripes and lines from an edge to the faces that meet there
const kAtCrease = 2.5; // steps from an edge, where the mesh of a face that meets another one ends
const kEnd = 3; // steps beyond its ends that a rim goes on to a corner, and this share of its length
const kEndShare = 0.12;
const kSameDepth = 0.03; // of the distance: what is so much nearer or farther is something else
const kRound = 0.4; // of what is near an edge and on neither face: more is a rounded one
const kOneSide = 0.85; // of a face's members near an edge that it is to lie on one side of
const kLeastVolume = 0.08; // of three unit normals: flatter corners are none

/** A plane that a place is on: normal · X = offset. */
interface Bound {
  readonly normal: Vec3;
  readonly offset: number;
  /** Of normal · X there. */
  variance(x: Vec3): number;
}

/** Where one of the faces ends, or two meet. */
interface Edge {
  readonly faces: readonly Face[];
  readonly bounds: readonly [Bound, Bound];
  readonly direction: Vec3; // unit
  /** Whether it goes as far as this place of it. */
  reaches(x: Vec3): boolean;
  /** From a place of it to where the mesh may end instead. */
  toMesh(x: Vec3): Vec3;
}

/** `focus`: a vertex of the surface, or a place on it, that is near what is meant. Null: nothing is there to snap to. */
export function snap(surface: Surface, focus: Vec3, pointer: Pointer, seen: Seen | null): Snapped | null {
  const centre = [focus[0] / focus[2], focus[1] / focus[2]] as const;
  const reach = seen === null ? kReachUnknown : (kReach * seen.camera.width) / seen.camera.fx;
  const patch = patchAround(surface, centre, reach);
  const faces = findFaces(patch);
  if (faces.length === 0) return null;
  const met = creases(patch, faces);
  const edges = [...met, ...(seen === null ? [] : rims(surface, patch, faces, met, seen, pointer))];
  return nearestCorner(edges, pointer) ?? nearestEdge(edges, pointer);
}

const unit = (a: Vec3): Vec3 => scaled(a, 1 / Math.sqrt(dot(a, a)));
const plus = (a: Vec3, b: Vec3): Vec3 => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];

const boundOf = ({ plane, covariance: c }: Face): Bound => ({
  normal: plane,
  offset: 1,
  variance: (x) => dot(x, [0, 1, 2].map((i) => c[0][i]! * x[0] + c[1][i]! * x[1] + c[2][i]! * x[2]) as Vec3),
});

function creases(patch: Patch, faces: readonly Face[]): Edge[] {
  const found: Edge[] = [];
  for (const [i, a] of faces.entries()) {
    for (const b of faces.slice(i + 1)) {
      const across = cross(unit(a.plane), unit(b.plane));
      if (Math.sqrt(dot(across, across)) < Math.sin(kSharp)) continue;
      const edge: Edge = {
        faces: [a, b],
        bounds: [boundOf(a), boundOf(b)],
        direction: unit(across),
        reaches: (x) => meetAt(patch, a, b, unit(across), x),
        toMesh: (x) => x,
      };
      found.push(edge);
    }
  }
  return found;
}

/** Both faces are there, on their own sides of the edge as the camera sees it, with nothing round between them. */
function meetAt(patch: Patch, a: Face, b: Face, direction: Vec3, x: Vec3): boolean {
  if (!(x[2] > 0)) return false;
  const sheet = cross(direction, x); // of the rays to the edge
  const sides = [a, b].map((face) => sideOf(patch, face, sheet, x));
  return sides[0] !== 0 && sides[1] === -sides[0]! && isSharp(patch, a, b, x);
}

/** Most of what is near is on one of the faces. */
function isSharp({ u, v, w, count }: Patch, a: Face, b: Face, x: Vec3): boolean {
  const [u0, v0] = [x[0] / x[2], x[1] / x[2]];
  const [wide, high] = [kNear[0] * Math.max(a.step.u, b.step.u), kNear[1] * Math.max(a.step.v, b.step.v)];
  let [on, off] = [0, 0];
  for (let i = 0; i < count; ++i) {
    if (Math.abs(u[i]! - u0) > wide || Math.abs(v[i]! - v0) > high || Math.abs(w[i]! * x[2] - 1) > kSameDepth) continue;
    if (a.fits[i] === 1 || b.fits[i] === 1) ++on;
    else ++off;
  }
  return off < kRound * (on + off);
}

/** 1 or -1; 0: the face is not there, or on both. */
function sideOf({ u, v, count }: Patch, { members, step }: Face, sheet: Vec3, x: Vec3): number {
  const [u0, v0] = [x[0] / x[2], x[1] / x[2]];
  let [near, left, right] = [false, 0, 0];
  for (let i = 0; i < count; ++i) {
    if (members[i] !== 1) continue;
    const [du, dv] = [Math.abs(u[i]! - u0) / step.u, Math.abs(v[i]! - v0) / step.v];
    if (du > 3 * kNear[0] || dv > 2 * kNear[1]) continue;
    if (du <= kNear[0] && dv <= kNear[1]) near = true;
    if (sheet[0] * u[i]! + sheet[1] * v[i]! + sheet[2] > 0) ++right;
    else ++left;
  }
  if (!near || Math.max(left, right) < kOneSide * (left + right)) return 0;
  return right > left ? 1 : -1;
}

function rims(surface: Surface, patch: Patch, faces: readonly Face[], met: readonly Edge[], seen: Seen, pointer: Pointer): Edge[] {
  const rough = faces
    .flatMap((face) => meshRims(patch, face).map((rim) => ({ face, rim })))
    .filter(({ face, rim }) => isNear(face, rim, pointer) && !met.some((crease) => isAt(crease, face, rim)));
  const hidden = hides(surface, patch, rough, seen);
  const open = rough.filter((_, i) => !hidden[i]);
  const crop = open.length === 0 ? null : seen.crop(patch.centre, 1.3 * patch.reach);
  return open.map(({ face, rim }) => rimEdge(face, (crop && pictureRim(rim, crop)) ?? rim));
}

/** Whether it may be meant, as far as the mesh tells. */
function isNear(face: Face, rim: Rim, pointer: Pointer): boolean {
  const edge = rimEdge(face, rim);
  const nearest = placeOn(edge, pointer);
  return nearest !== null && edge.reaches(nearest.point) && offBy([edge], nearest.point, { ...pointer, slack: kRough * pointer.slack }) !== null;
}

/** Whether a face ends there because it meets another. */
function isAt(crease: Edge, face: Face, { normal: [nu, nv], offset, from, to }: Rim): boolean {
  if (!crease.faces.includes(face)) return false;
  return [0.25, 0.75].every((share) => {
    const along = from + share * (to - from);
    const [u, v] = [nu * offset - nv * along, nv * offset + nu * along];
    const near = placeOn(crease, { origin: [0, 0, 0], direction: [u, v, 1] });
    if (near === null || !crease.reaches(near.point)) return false;
    const [x, y, z] = near.point;
    return Math.abs(x / z - u) / face.step.u + Math.abs(y / z - v) / face.step.v < kAtCrease;
  });
}

function rimEdge(face: Face, rim: Rim): Edge {
  const [nu, nv] = rim.normal;
  const sheet: Vec3 = [nu, nv, -rim.offset]; // the rays that the rim is seen along
  const along = (x: Vec3): number => (-nv * x[0] + nu * x[1]) / x[2];
  const slack = kEnd * (Math.abs(nv) * face.step.u + Math.abs(nu) * face.step.v) + kEndShare * (rim.to - rim.from);
  return {
    faces: [face],
    bounds: [boundOf(face), { normal: sheet, offset: 0, variance: (x) => x[2] ** 2 * rim.variance(along(x)) }],
    direction: unit(cross(face.plane, sheet)),
    reaches: (x) => x[2] > 0 && along(x) >= rim.from - slack && along(x) <= rim.to + slack,
    toMesh: (x) => onFace(face, x[0] / x[2] - nu * rim.lack, x[1] / x[2] - nv * rim.lack),
  };
}

/** Where a ray meets the face's plane. */
export function onFace({ plane: [a, b, c] }: Face, u: number, v: number): Vec3 {
  const z = 1 / (a * u + b * v + c);
  return [u * z, v * z, z];
}

/** By how many pixels of the page a place is off, where that is near enough; what the mesh lacks there, which a person cannot see, is as the place. */
function offBy(edges: readonly Edge[], x: Vec3, { at, slack, toPage }: Pointer): number | null {
  const page = toPage(x);
  if (page === null) return null;
  const lacks = edges.map((edge) => {
    const mesh = toPage(edge.toMesh(x)) ?? page;
    return [mesh.x - page.x, mesh.y - page.y] as const;
  });
  lacks.push(lacks.reduce(([x0, y0], [x1, y1]) => [x0 + x1, y0 + y1], [0, 0])); // of a corner: where both are missing
  const off = Math.min(...lacks.map((lack) => toSegment(at.x - page.x, at.y - page.y, lack)));
  return off <= slack ? off : null;
}

/** How far a place is from the line between here and there. */
function toSegment(x: number, y: number, [ex, ey]: readonly [number, number]): number {
  const size2 = ex * ex + ey * ey;
  const share = size2 > 0 ? Math.min(1, Math.max(0, (x * ex + y * ey) / size2)) : 0;
  return Math.hypot(x - share * ex, y - share * ey);
}

/** Where three planes meet, with the errors of each. */
function meet(bounds: readonly [Bound, Bound, Bound]): { point: Vec3; errors: Vec3[] } | null {
  const sizes = bounds.map(({ normal }) => Math.sqrt(dot(normal, normal)));
  const [a, b, c] = bounds.map(({ normal }, i) => scaled(normal, 1 / sizes[i]!)) as [Vec3, Vec3, Vec3];
  if (Math.abs(dot(a, cross(b, c))) < kLeastVolume) return null;
  const columns = inverseColumns(a, b, c);
  if (columns === null) return null;
  const terms = bounds.map(({ offset }, i) => scaled(columns[i]!, offset / sizes[i]!));
  const point = terms.reduce(plus);
  const errors = bounds.map((bound, i) => scaled(columns[i]!, Math.sqrt(bound.variance(point)) / sizes[i]!));
  return { point, errors };
}

function nearestCorner(edges: readonly Edge[], pointer: Pointer): Snapped | null {
  let best: { off: number; sigma: number; snapped: Snapped } | null = null;
  for (const [i, one] of edges.entries()) {
    for (const other of edges.slice(i + 1)) {
      const shared = one.faces.find((face) => other.faces.includes(face));
      if (shared === undefined) continue;
      const third = other.bounds[other.faces.indexOf(shared) === 0 ? 1 : 0];
      const met = meet([...one.bounds, third]);
      if (met === null || !one.reaches(met.point) || !other.reaches(met.point)) continue;
      const off = offBy([one, other], met.point, pointer);
      if (off === null) continue;
      const sigma = Math.hypot(...met.errors.flat());
      // Of the same corner by other planes, the one that is known best.
      const better = best === null || (Math.abs(off - best.off) < pointer.slack / 3 ? sigma < best.sigma : off < best.off);
      if (better) best = { off, sigma, snapped: { kind: 'corner', ...met, line: null } };
    }
  }
  return best?.snapped ?? null;
}

function nearestEdge(edges: readonly Edge[], pointer: Pointer): Snapped | null {
  let best: { off: number; snapped: Snapped } | null = null;
  for (const edge of edges) {
    const through = placeOn(edge, pointer);
    if (through === null || !edge.reaches(through.point)) continue;
    const off = offBy([edge], through.point, pointer);
    if (off === null || (best !== null && off >= best.off)) continue;
    const half = 0.03 * through.point[2];
    const line = [-half, half].map((by) => plus(through.point, scaled(edge.direction, by))) as [Vec3, Vec3];
    best = { off, snapped: { kind: 'edge', ...through, line } };
  }
  return best?.snapped ?? null;
}

/** The place of the edge that is nearest to the pointer's ray; where along it is the person's choice and has no error. */
function placeOn({ bounds, direction }: Edge, pointer: Pick<Pointer, 'origin' | 'direction'>): { point: Vec3; errors: Vec3[] } | null {
  const exactly = (offset: number): Bound => ({ normal: direction, offset, variance: () => 0 });
  const foot = meet([...bounds, exactly(0)]);
  if (foot === null) return null;
  // Of two lines, the place of the first that is nearest to the second.
  const ray = unit(pointer.direction);
  const apart = plus(pointer.origin, scaled(foot.point, -1));
  const along = dot(direction, ray);
  const sine2 = 1 - along * along;
  if (sine2 < 1e-6) return null;
  const by = (dot(apart, direction) - along * dot(apart, ray)) / sine2;
  const met = meet([...bounds, exactly(by)]);
  return met === null ? null : { point: met.point, errors: met.errors.slice(0, 2) };
}
