// SPDX-License-Identifier: Apache-2.0
// Proves: near an edge or a corner of flat faces a click is on it, also where the mesh ends before the face does, by no more
// than its errors say; and nowhere else: not on what is bent or rounded, nor where shadows or nearer things end a face.
import { describe, expect, it } from 'vitest';
import type { Surface, Vec3 } from '../src/pick';
import type { Pinhole } from '../src/protocol';
import { snap, type Pointer, type Seen, type Snapped } from '../src/snap';
import { box, kProjector, meshOf, onBox, pictureOf, seenOf, wall, type Met, type Scene } from './stripeScene';

const kAt: Vec3 = [0.03, 0.02, 0.95];
const kHalf = 0.05;
const kCamera: Pinhole = { width: 400, height: 260, fx: 1050, fy: 1050, cx: 199.5, cy: 129.5 };
const kPageScale = 1.5; // pixels of the page a pixel of the camera

const toPage = ([x, y, z]: Vec3): { x: number; y: number } => ({
  x: kPageScale * ((kCamera.fx * x) / z + kCamera.cx),
  y: kPageScale * ((kCamera.fy * y) / z + kCamera.cy),
});

/** By a click so many pixels of the page beside this place. */
function clicked(surface: Surface, seen: Seen | null, place: Vec3, [right, down] = [3, 2]): Snapped | null {
  const page = toPage(place);
  const at = { x: page.x + right!, y: page.y + down! };
  const direction: Vec3 = [(at.x / kPageScale - kCamera.cx) / kCamera.fx, (at.y / kPageScale - kCamera.cy) / kCamera.fy, 1];
  return snap(surface, place, { at, origin: [0, 0, 0], direction, slack: 10, toPage } satisfies Pointer, seen);
}

const away = (a: Vec3, b: Vec3): number => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
/** By how many of its standard deviations it is off, along the direction where it is off. */
function offInSigmas({ point, errors }: Snapped, truth: Vec3): number {
  const off = point.map((c, i) => c - truth[i]!) as Vec3;
  const size = Math.hypot(...off);
  const sigma = Math.hypot(...errors.map((e) => e.reduce((sum, c, i) => sum + (c * off[i]!) / size, 0)));
  return size / sigma;
}

const cube = box(kAt, 0.5, [kHalf, kHalf, kHalf], { '-z': [160, 88, 70], '+x': [120, 66, 52], '-y': [60, 33, 26] });
const scene: Scene = { shapes: [cube.shape, wall(1.2, [110, 108, 104])], lit: (place) => !cube.blocks(kProjector, place) };
const mesh = meshOf(scene, 0.06, kCamera);
const seen = seenOf(pictureOf(scene, 2, kCamera), kCamera);
const corner = (x: number, y: number, z: number): Vec3 => onBox(kAt, 0.5, [x * kHalf, y * kHalf, z * kHalf]);
const corners = [corner(-1, -1, -1), corner(1, -1, -1), corner(1, 1, -1), corner(-1, 1, -1)];

const onFront = (place: Vec3): boolean => Math.abs((place[0] - kAt[0]) * Math.sin(0.5) + (place[2] - kAt[2]) * Math.cos(0.5) + kHalf) < 0.003;

describe('a cube of 100 mm before a wall', () => {
  it('has its corners and edges to a fifth of a pixel', () => {
    const found = corners.map((place) => clicked(mesh, seen, place)!);
    expect(found.map((f) => f?.kind)).toEqual(['corner', 'corner', 'corner', 'corner']);
    for (const [i, f] of found.entries()) {
      expect(away(f.point, found[(i + 1) % 4]!.point)).toBeGreaterThan(0.0998);
      expect(away(f.point, found[(i + 1) % 4]!.point)).toBeLessThan(0.1002);
      expect(offInSigmas(f, corners[i]!)).toBeLessThan(3.5);
    }
  });

  it('has points on its edges, that are exact across them', () => {
    for (const [a, b] of [[1, 2], [0, 3], [0, 1], [3, 2]] as const) {
      const middle = corners[a]!.map((c, i) => 0.6 * c + 0.4 * corners[b]![i]!) as Vec3;
      const found = clicked(mesh, seen, middle, [-4, -3])!;
      expect(found?.kind).toBe('edge');
      const along = corners[b]!.map((c, i) => (c - corners[a]![i]!) / 0.1) as Vec3;
      const off = found.point.map((c, i) => c - corners[a]![i]!) as Vec3;
      const by = off.reduce((sum, c, i) => sum + c * along[i]!, 0);
      expect(Math.hypot(...off.map((c, i) => c - by * along[i]!))).toBeLessThan(0.0002);
      // Where along the edge is the person's choice.
      for (const error of found.errors) expect(Math.abs(error.reduce((sum, c, i) => sum + c * along[i]!, 0))).toBeLessThan(1e-5);
      expect(found.line).not.toBeNull();
    }
  });

  it('has nothing to snap to within its faces, and on the wall', () => {
    for (const place of [[-0.4, 0.1, -1], [0.3, 0.5, -1]] as const) {
      expect(clicked(mesh, seen, onBox(kAt, 0.5, place.map((c) => c * kHalf) as Vec3))).toBeNull();
    }
    expect(clicked(mesh, seen, [0.17, 0.1, 1.2])).toBeNull();
  });

  it('gives the wall no outline where the cube or its shadow ends it', () => {
    // Beyond the slack of the cube's own rims.
    for (const v of [0, 0.02, 0.04, 0.06]) {
      for (let u = -0.16; u < -0.035; u += 0.004) {
        const snapped = clicked(mesh, seen, [1.2 * u, 1.2 * v, 1.2], [0, 0]);
        if (snapped !== null) expect(snapped.point[2], `at ${u} ${v}`).toBeLessThan(1.1);
      }
    }
  });

  it.each([1, 2, 3])('has its edge beside a face of few stripes, each with an error of its own: %i', (seed) => {
    const uneven = meshOf(scene, 0.06, kCamera, undefined, { by: 0.12, seed: 7919 * seed });
    expect(clicked(uneven, null, corner(1, 0.2, -1))?.kind).toBe('edge');
  });

  it('is known to a step of the mesh where there is no picture', () => {
    const found = clicked(mesh, seenOf(null, kCamera), corners[0]!)!;
    expect(found.kind).toBe('corner');
    expect(away(found.point, corners[0]!)).toBeLessThan(0.01);
    expect(offInSigmas(found, corners[0]!)).toBeLessThan(3);
    expect(Math.hypot(...found.errors.flat())).toBeGreaterThan(0.001);
  });

  it('has only the edge between two faces where nothing is known of the camera', () => {
    const middle = corners[1]!.map((c, i) => 0.5 * c + 0.5 * corners[2]![i]!) as Vec3;
    expect(clicked(mesh, null, middle)?.kind).toBe('edge');
    expect(clicked(mesh, null, corners[0]!)).toBeNull();
  });
});

/** What is left of it without some of its vertices. */
function without({ positions, triangles, quality }: Surface, isLost: (place: Vec3) => boolean): Surface {
  const placeOf = (i: number): Vec3 => [positions[3 * i]!, positions[3 * i + 1]!, positions[3 * i + 2]!];
  const kept = Array.from({ length: positions.length / 3 }, (_, i) => i).filter((i) => !isLost(placeOf(i)));
  const now = new Map(kept.map((i, at) => [i, at]));
  const whole: number[] = [];
  for (let t = 0; t < triangles.length; t += 3) {
    const corners = [0, 1, 2].map((k) => now.get(triangles[t + k]!));
    if (corners.every((corner) => corner !== undefined)) whole.push(...corners);
  }
  return {
    positions: Float32Array.from(kept.flatMap(placeOf)),
    coordinates: null,
    triangles: Uint32Array.from(whole),
    quality: { sigmas: Float32Array.from(kept, (i) => quality!.sigmas[i]!), interpolated: new Uint8Array(kept.length) },
  };
}

it('a rim in the picture is known the worse the more of a step it is beyond its mesh', () => {
  const left = corners[0]!.map((c, i) => 0.5 * c + 0.5 * corners[3]![i]!) as Vec3;
  const right = corners[1]!.map((c, i) => (c - corners[0]![i]!) / 0.1) as Vec3;
  const inwards = (place: Vec3): number => place.reduce((sum, c, i) => sum + (c - left[i]!) * right[i]!, 0);
  const whole = meshOf(scene, 0.06, kCamera, 89); // its outermost stripe is 2.4 mm from the rim, the next one 13.6
  const cut = without(whole, (place) => onFront(place) && inwards(place) < 0.008);
  const [near, far] = [whole, cut].map((surface) => Math.hypot(...clicked(surface, seen, left)!.errors.flat()));
  expect(near).toBeLessThan(0.0002);
  expect(far).toBeGreaterThan(0.0023); // 13.6 mm less a step, about
});

/** Of a sphere. */
const ball = ([x, y, z]: Vec3, radius: number): ((u: number, v: number) => Met | null) => (u, v) => {
  const [a, b, c] = [u * u + v * v + 1, u * x + v * y + z, x * x + y * y + z * z - radius * radius];
  const root = b * b - a * c;
  return root < 0 ? null : { z: (b - Math.sqrt(root)) / a, part: 'ball', colour: [150, 130, 90] };
};

it.each([0.05, 0.12, 0.3])('nothing that is bent has edges: a radius of %d m', (radius) => {
  const round: Scene = { shapes: [ball([0, 0, 0.9 + radius], radius)] };
  const surface = meshOf(round, 0.06, kCamera);
  const picture = seenOf(pictureOf(round, 2, kCamera), kCamera);
  for (let i = 0; i < surface.positions.length; i += 3 * Math.ceil(surface.positions.length / 3 / 60)) {
    expect(clicked(surface, picture, [...surface.positions.slice(i, i + 3)] as Vec3), `${i}`).toBeNull();
  }
});

/** Two planes at a right angle, x off the axis, turned towards the camera; rounded by a cylinder of this radius. */
const roof = (radius: number): ((u: number, v: number) => Met | null) => (u) => {
  const colour: Vec3 = [150, 130, 90];
  const ridge = 0.9;
  const z = ridge / (1 - Math.abs(u)); // z = ridge + |x|
  if (Math.abs(u * z) >= radius * Math.SQRT1_2) return { z, part: 'roof', colour };
  const centre = ridge + radius * Math.SQRT2;
  const [a, b, c] = [u * u + 1, centre, centre * centre - radius * radius];
  return { z: (b - Math.sqrt(b * b - a * c)) / a, part: 'roof', colour };
};

it('a rounded edge is none, a sharp one is', () => {
  const [sharp, round] = [1e-6, 0.02].map((radius) => meshOf({ shapes: [roof(radius)] }, 0.06, kCamera));
  const found = clicked(sharp!, null, [0, 0.01, 0.9])!;
  expect(found.kind).toBe('edge');
  expect(Math.hypot(found.point[0], found.point[2] - 0.9)).toBeLessThan(0.0002);
  expect(clicked(round!, null, [0, 0.01, 0.9 + 0.02 * (Math.SQRT2 - 1)])).toBeNull();
});
