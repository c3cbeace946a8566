// SPDX-License-Identifier: Apache-2.0
// Whether a face only seems to end: where something nearer hides it from the camera or keeps the projector's light from
// it, where the light or the picture ends, or where it goes on behind a gap. Pure.
import type { Face } from './faces';
import { dot, indicesOf, type Patch } from './patch';
import type { Rim } from './outline';
import type { Surface, Vec3 } from './pick';
import type { Pinhole } from './protocol';
import { inverse, moved, type Rigid } from './rigid';

export interface Situation {
  readonly camera: Pinhole;
  /** Null: not known. */
  readonly light: Light | null;
}

export interface Light {
  readonly projector: Pinhole;
  readonly projectorFromCamera: Rigid;
  readonly stripes: number;
}

export interface Ending {
  readonly face: Face;
  readonly rim: Rim;
}

const kPlaces = [0.15, 0.38, 0.62, 0.85]; // of a rim, where it is looked beyond
const kHidden = 2; // of these, at least
const kNearer = 0.006; // of the distance
const kStripes = 2.5; // steps within which what hides is looked for: its own mesh ends too early, too
const kLines = 3;
const kGoesOn = 0.03; // of a face's vertices, beyond its rim

/** Of each: whether the face does not end there. */
export function hides(surface: Surface, patch: Patch, endings: readonly Ending[], seen: Situation): boolean[] {
  const beyond = endings.map(({ face, rim }) => kPlaces.map((share) => placeBeyond(face, rim, share)));
  const counts = beyond.map((places, i) => {
    const { face } = endings[i]!;
    return places.filter((place) => coversFromCamera(patch, face, place) || !isLit(place, seen)).length;
  });
  if (seen.light !== null) {
    const shadows = shadowsOn(surface, endings, beyond.flat(), seen.light);
    for (const [i, places] of beyond.entries()) {
      counts[i]! += places.filter((_, k) => shadows[kPlaces.length * i + k]).length;
    }
  }
  return endings.map(({ face, rim }, i) => counts[i]! >= kHidden || goesOn(patch, face, rim));
}

/** On the face's plane, a step and a bit beyond where its mesh ends. */
function placeBeyond({ plane: [a, b, c] }: Face, { normal: [nu, nv], offset, from, to, step }: Rim, share: number): Vec3 {
  const [along, out] = [from + share * (to - from), offset + 0.7 * step];
  const [u, v] = [nu * out - nv * along, nv * out + nu * along];
  const z = 1 / (a * u + b * v + c);
  return [u * z, v * z, z];
}

function coversFromCamera({ u, v, w, count }: Patch, { plane: [a, b, c], step }: Face, [x, y, z]: Vec3): boolean {
  const [u0, v0] = [x / z, y / z];
  for (let i = 0; i < count; ++i) {
    if (Math.abs(u[i]! - u0) > kStripes * step.u || Math.abs(v[i]! - v0) > kLines * step.v) continue;
    if (w[i]! > (1 + kNearer) * (a * u[i]! + b * v[i]! + c)) return true;
  }
  return false;
}

/** Whether it lies in both devices' pictures. */
function isLit(place: Vec3, { camera, light }: Situation): boolean {
  if (!shows(camera, place, 3)) return false;
  if (light === null) return true;
  const { projector, projectorFromCamera, stripes } = light;
  return shows(projector, moved(projectorFromCamera, place), (2 * projector.width) / stripes);
}

function shows({ width, height, fx, fy, cx, cy }: Pinhole, [x, y, z]: Vec3, margin: number): boolean {
  const [column, row] = [(fx * x) / z + cx, (fy * y) / z + cy];
  return z > 0 && column > margin && row > margin && column < width - 1 - margin && row < height - 1 - margin;
}

/** Of each place: whether a vertex, or what the mesh lacks beside one, lies between it and the projector. */
function shadowsOn({ positions: p }: Surface, endings: readonly Ending[], places: readonly Vec3[], light: Light): boolean[] {
  const { projector, projectorFromCamera, stripes } = light;
  const { rotation: r, translation: t } = projectorFromCamera;
  const [stripe, line] = [(1.5 * projector.width) / stripes / projector.fx, 3 / projector.fy];
  const centre = inverse(projectorFromCamera).translation;
  const at = places.map((place, i) => {
    const [x, y, z] = moved(projectorFromCamera, place);
    const { plane } = endings[Math.floor(i / kPlaces.length)]!.face;
    return { u: x / z, v: y / z, z, plane, side: Math.sign(1 - dot(plane, centre)), found: false };
  });
  for (let i = 0; i < p.length; i += 3) {
    const vertex: Vec3 = [p[i]!, p[i + 1]!, p[i + 2]!];
    const depth = r[6]! * vertex[0] + r[7]! * vertex[1] + r[8]! * vertex[2] + t[2];
    const u = (r[0]! * vertex[0] + r[1]! * vertex[1] + r[2]! * vertex[2] + t[0]) / depth;
    const v = (r[3]! * vertex[0] + r[4]! * vertex[1] + r[5]! * vertex[2] + t[1]) / depth;
    for (const place of at) {
      if (place.found || Math.abs(u - place.u) > stripe || Math.abs(v - place.v) > line || depth > place.z) continue;
      place.found = place.side * (1 - dot(place.plane, vertex)) > kNearer; // before the face's plane
    }
  }
  return at.map(({ found }) => found);
}

/** Whether the same plane has more beyond. */
function goesOn({ u, v }: Patch, { fits, members }: Face, { normal: [nu, nv], offset, from, to, step }: Rim): boolean {
  let beyond = 0;
  for (const i of indicesOf(fits)) {
    const along = -nv * u[i]! + nu * v[i]!;
    if (nu * u[i]! + nv * v[i]! > offset + 0.8 * step && along > from && along < to) ++beyond;
  }
  return beyond > kGoesOn * indicesOf(members).length;
}
