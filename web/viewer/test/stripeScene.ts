// SPDX-License-Identifier: Apache-2.0
// A camera and a projector before plain shapes: the mesh that stripes make of it, and the camera's picture.
import type { Crop } from '../src/pictureRim';
import type { Surface, Vec3 } from '../src/pick';
import type { Pinhole } from '../src/protocol';
import type { Seen } from '../src/snap';

/** What a ray from the origin meets: its depth (z), a name for the part, and its colour. */
export interface Met {
  z: number;
  part: string;
  colour: Vec3;
}
export type Shape = (u: number, v: number) => Met | null;

export const kCamera: Pinhole = { width: 640, height: 480, fx: 1050, fy: 1050, cx: 319.5, cy: 239.5 };
const kTurn = Math.atan2(0.25, 1);
const [kSine, kCosine] = [Math.sin(kTurn), Math.cos(kTurn)];
export const kLight = {
  projector: { width: 1024, height: 768, fx: 1400, fy: 1400, cx: 511.5, cy: 383.5 },
  projectorFromCamera: {
    rotation: [kCosine, 0, kSine, 0, 1, 0, -kSine, 0, kCosine],
    translation: [-0.25 * kCosine, -0.02, 0.25 * kSine] as Vec3,
  },
  stripes: 90,
};

const { rotation: kR, translation: kT } = kLight.projectorFromCamera;
export const kProjector = [0, 1, 2].map((i) => -(kR[i]! * kT[0]! + kR[i + 3]! * kT[1]! + kR[i + 6]! * kT[2]!)) as Vec3;

export function randomNormal(seed: number): () => number {
  let state = seed;
  const random = (): number => (state = (state * 48271) % 2147483647) / 2147483647;
  return () => Math.sqrt(-2 * Math.log(random())) * Math.cos(2 * Math.PI * random());
}

const projectorColumn = ([x, y, z]: Vec3): number => {
  const { rotation: r, translation: t } = kLight.projectorFromCamera;
  const [px, pz] = [r[0]! * x + r[1]! * y + r[2]! * z + t[0], r[6]! * x + r[7]! * y + r[8]! * z + t[2]];
  return (kLight.projector.fx * px) / pz + kLight.projector.cx;
};

const nearest = (shapes: readonly Shape[], u: number, v: number): Met | null =>
  shapes.map((shape) => shape(u, v)).reduce((a, b) => (b !== null && (a === null || b.z < a.z) ? b : a), null);

/** Whether the projector's light gets there. */
type Lit = (place: Vec3) => boolean;

export interface Scene {
  shapes: readonly Shape[];
  lit?: Lit;
}

/**
 * `noise`: of a boundary's column, pixels; `shared`: what all places of a boundary are off by besides, which no deviation says.
 * A boundary within a pixel of another part is lost, as decoders lose it.
 */
export function meshOf({ shapes, lit }: Scene, noise = 0.06, camera = kCamera, stripes = kLight.stripes, shared = { by: 0, seed: 1 }): Surface {
  const normal = randomNormal(7);
  const ofBoundary = Array.from({ length: stripes + 1 }, ((random) => () => shared.by * random())(randomNormal(shared.seed)));
  const [positions, coordinates, triangles, sigmas]: [number[], number[], number[], number[]] = [[], [], [], []];
  let above = new Map<number, { index: number; part: string }>();
  const finer = 4;
  for (let row = 0; row < camera.height; ++row) {
    const v = (row - camera.cy) / camera.fy;
    const line = new Map<number, { index: number; part: string }>();
    let before: { met: Met; column: number } | null = null;
    for (let s = 0; s <= (camera.width - 1) * finer; ++s) {
      const u = (s / finer - camera.cx) / camera.fx;
      const met = nearest(shapes, u, v);
      const place: Vec3 | null = met && [u * met.z, v * met.z, met.z];
      if (met === null || place === null || lit?.(place) === false) {
        before = null;
        continue;
      }
      const column = projectorColumn(place);
      if (before !== null && before.met.part === met.part && column > before.column) {
        const width = kLight.projector.width / stripes;
        const boundary = Math.ceil((before.column + 0.5) / width - 1);
        const at = (boundary + 1) * width - 0.5;
        const beside = [-finer, finer].map((by) => nearest(shapes, u + by / finer / camera.fx, v)?.part);
        if (at >= before.column && at < column && beside.every((part) => part === met.part)) {
          // What is off in the column is off in the depth along the ray.
          const share = (at - before.column) / (column - before.column);
          const exact = s / finer - (1 - share) / finer;
          const u0 = (exact - camera.cx) / camera.fx;
          const z0 = nearest(shapes, u0, v)!.z;
          const slope = (z0 * z0) / (camera.fx * 0.25);
          const z = z0 + (normal() * noise + ofBoundary[boundary]!) * slope;
          line.set(boundary, { index: positions.length / 3, part: met.part });
          positions.push(u0 * z, v * z, z);
          coordinates.push((exact + 0.5) / camera.width, (row + 0.5) / camera.height);
          sigmas.push(noise * slope);
        }
      }
      before = { met, column };
    }
    for (const [boundary, b] of line) {
      const [a, c, d] = [above.get(boundary), above.get(boundary + 1), line.get(boundary + 1)];
      if (a === undefined || c === undefined || d === undefined) continue;
      const near = [a, c, d].every(({ index }) => Math.abs(positions[3 * index + 2]! - positions[3 * b.index + 2]!) < 0.04);
      if (near) triangles.push(a.index, b.index, d.index, d.index, c.index, a.index);
    }
    above = line;
  }
  return {
    positions: Float32Array.from(positions),
    coordinates: Float32Array.from(coordinates),
    triangles: Uint32Array.from(triangles),
    quality: { sigmas: Float32Array.from(sigmas), interpolated: new Uint8Array(sigmas.length) },
  };
}

/** As a camera sees it whose pixels are what falls on them. */
export function pictureOf({ shapes, lit }: Scene, noise = 2, camera = kCamera): Uint8ClampedArray {
  const normal = randomNormal(11);
  const out = new Uint8ClampedArray(camera.width * camera.height * 4);
  const at = (column: number, row: number): { part: string; colour: Vec3 } => {
    const [u, v] = [(column - camera.cx) / camera.fx, (row - camera.cy) / camera.fy];
    const met = nearest(shapes, u, v);
    if (met === null) return { part: '', colour: [0, 0, 0] };
    const isLit = lit?.([u * met.z, v * met.z, met.z]) !== false;
    return { part: `${met.part} ${isLit}`, colour: isLit ? met.colour : (met.colour.map((c) => 0.08 * c) as Vec3) };
  };
  const stride = camera.width + 1;
  const corners = Array.from({ length: stride * (camera.height + 1) }, (_, i) => at((i % stride) - 0.5, Math.floor(i / stride) - 0.5));
  const finer = 10;
  for (let row = 0; row < camera.height; ++row) {
    for (let column = 0; column < camera.width; ++column) {
      const i = row * stride + column;
      const { part, colour } = corners[i]!;
      let sum = colour;
      if ([1, stride, stride + 1].some((by) => corners[i + by]!.part !== part)) {
        const parts = Array.from({ length: finer * finer }, (_, k) =>
          at(column + ((k % finer) + 0.5) / finer - 0.5, row + (Math.floor(k / finer) + 0.5) / finer - 0.5),
        );
        sum = [0, 1, 2].map((c) => parts.reduce((all, one) => all + one.colour[c]! / parts.length, 0)) as Vec3;
      }
      for (let c = 0; c < 3; ++c) out[4 * (row * camera.width + column) + c] = sum[c]! + noise * normal();
    }
  }
  return out;
}

export function seenOf(picture: Uint8ClampedArray | null, camera = kCamera): Seen {
  const crop: Crop = {
    x: 0,
    y: 0,
    width: camera.width,
    height: camera.height,
    rgba: picture ?? new Uint8ClampedArray(0),
    place: (u, v) => [u * camera.fx + camera.cx, v * camera.fy + camera.cy],
  };
  return { camera, light: kLight, crop: () => (picture === null ? null : crop) };
}

/** A box, turned around the vertical; `half` its size. `blocks`: what lies behind it from a place. */
export function box(centre: Vec3, turn: number, half: Vec3, colours: Record<string, Vec3>): { shape: Shape; blocks(from: Vec3, to: Vec3): boolean } {
  const [s, c] = [Math.sin(turn), Math.cos(turn)];
  const back = ([x, y, z]: Vec3): Vec3 => [c * x - s * z, y, s * x + c * z];
  const meets = (from: Vec3, way: Vec3): { along: number; part: string } | null => {
    const eye = back([from[0] - centre[0], from[1] - centre[1], from[2] - centre[2]]);
    const ray = back(way);
    let [enter, leave, part] = [-Infinity, Infinity, ''];
    for (const axis of [0, 1, 2]) {
      const [near, far] = [-1, 1].map((side) => (side * half[axis]! - eye[axis]!) / ray[axis]!).sort((a, b) => a - b) as [number, number];
      if (near > enter) [enter, part] = [near, `${ray[axis]! > 0 ? '-' : '+'}${'xyz'[axis]}`];
      leave = Math.min(leave, far);
    }
    return enter < leave && enter > 0 ? { along: enter, part } : null;
  };
  return {
    shape: (u, v) => {
      const met = meets([0, 0, 0], [u, v, 1]);
      return met === null ? null : { z: met.along, part: met.part, colour: colours[met.part] ?? [150, 90, 70] };
    },
    blocks: (from, to) => {
      const met = meets(from, [to[0] - from[0], to[1] - from[1], to[2] - from[2]]);
      return met !== null && met.along < 0.999;
    },
  };
}

/** A place of such a box, in its own frame, in the camera's. */
export function onBox(centre: Vec3, turn: number, [x, y, z]: Vec3): Vec3 {
  const [s, c] = [Math.sin(turn), Math.cos(turn)];
  return [centre[0] + c * x + s * z, centre[1] + y, centre[2] - s * x + c * z];
}

export const wall = (z: number, colour: Vec3): Shape => () => ({ z, part: 'wall', colour });
