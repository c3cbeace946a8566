// SPDX-License-Identifier: Apache-2.0
// Proves: lengths, angles and sections of known shapes are true, and errors of depth go into them as they should.
import { describe, expect, it } from 'vitest';
import { alongRay, lengthText, markOf, measure, measurementsCsv, section, sectionCsv, type Spot } from '../src/measure';
import type { Surface, Vec3 } from '../src/pick';
import type { StreamInfo } from '../src/protocol';
import { rigDepthError, rigErrorOf } from '../src/rigError';
import { kNowhere, rigidOf } from '../src/rigid';

const errorsOf = (point: Vec3, sigma: number | null) => (sigma === null ? null : alongRay(point, sigma));
const spot = (point: Vec3, sigma: number | null = null): Spot => ({
  point,
  kind: 'surface',
  errors: errorsOf(point, sigma),
  stream: 'face',
  pose: kNowhere,
  rig: null,
});
const eye: Vec3 = [0, 0, 0];

/** A roof: z = 2 + |x| / 2 for x, y in -1..1. */
const roof: Surface = {
  positions: new Float32Array([-1, -1, 2.5, -1, 1, 2.5, 0, -1, 2, 0, 1, 2, 1, -1, 2.5, 1, 1, 2.5]),
  coordinates: null,
  triangles: new Uint32Array([0, 1, 3, 0, 3, 2, 2, 3, 5, 2, 5, 4]),
  quality: { sigmas: new Float32Array(6).fill(1e-3), interpolated: new Uint8Array(6) },
};

describe('measure', () => {
  it('tells distances and angles', () => {
    expect(measure('distance', [spot([0, 0, 1]), spot([0.3, 0.4, 1])], null, eye).value).toBeCloseTo(0.5, 12);
    expect(measure('angle', [spot([1, 0, 1]), spot([0, 0, 1]), spot([0, 2, 1])], null, eye).value).toBeCloseTo(Math.PI / 2, 12);
    expect(measure('point', [spot([0.1, 0.2, 1.3], 1e-4)], null, eye)).toMatchObject({ value: 1.3, sigma: expect.closeTo(1e-4, 9) });
  });

  it('takes errors along the rays of the camera', () => {
    // Along the axis depth errors count in full, across it only by how far off the axis the places are.
    const along = measure('distance', [spot([0, 0, 1], 3e-4), spot([0, 0, 2], 4e-4)], null, eye);
    expect(along.sigma).toBeCloseTo(5e-4, 9);
    const across = measure('distance', [spot([-0.5, 0, 1], 1e-3), spot([0.5, 0, 1], 1e-3)], null, eye);
    expect(across.sigma).toBeCloseTo(Math.SQRT2 * 0.5e-3, 7);
    expect(measure('distance', [spot([0, 0, 1], 1e-3), spot([1, 0, 1])], null, eye).sigma).toBeNull();
  });

  it('is true between streams, whose errors lie along the rays of either camera', () => {
    const of = (point: Vec3, angle: number, to: Vec3): Spot => ({ ...spot(point, 4e-4), stream: 'vase', pose: rigidOf([0, angle, 0], to) });
    const here = spot([0, 0, 1], 3e-4);
    // A camera that looks at the first one from 3 m ahead of it.
    const facing = measure('distance', [here, of([0, 0, 1.5], Math.PI, [0, 0, 3])], null, eye);
    expect(facing).toMatchObject({ value: expect.closeTo(0.5, 9), sigma: expect.closeTo(5e-4, 9) });
    // One that looks across: its errors of depth are none of the length.
    const across = measure('distance', [here, of([0, 0, 1], Math.PI / 2, [-1, 0, 2])], null, eye);
    expect(across).toMatchObject({ value: expect.closeTo(1, 9), sigma: expect.closeTo(3e-4, 9) });
    expect(measure('angle', [{ ...here, point: [1, 0, 2] as Vec3 }, of([0, 0, 1], Math.PI / 2, [-1, 0, 2]), here], null, eye).value).toBeCloseTo(Math.PI / 2, 9);
    expect(measure('point', [of([0, 0, 1.5], Math.PI, [0, 0, 3])], null, eye).value).toBe(1.5); // its own camera's depth
  });

  it('agrees with drawing errors at random', () => {
    let seed = 1;
    const random = (): number => (seed = (seed * 48271) % 2147483647) / 2147483647;
    const normal = (): number => Math.sqrt(-2 * Math.log(random())) * Math.cos(2 * Math.PI * random());
    const spots = [spot([-0.3, 0.1, 1], 1e-3), spot([0.2, -0.2, 1.2], 2e-3), spot([0.3, 0.3, 0.9], 1.5e-3)];
    const told = measure('angle', spots, null, eye);
    const drawn = Array.from({ length: 20_000 }, () => {
      const moved = spots.map(({ point, errors }) => {
        const by = normal();
        return spot(point.map((c, i) => c + by * errors![0]![i]!) as Vec3);
      });
      return measure('angle', moved, null, eye).value - told.value;
    });
    const deviation = Math.sqrt(drawn.reduce((sum, d) => sum + d * d, 0) / drawn.length);
    expect(deviation / told.sigma!).toBeGreaterThan(0.95);
    expect(deviation / told.sigma!).toBeLessThan(1.05);
  });
});

const [s, c] = [Math.sin(0.2), Math.cos(0.2)];
const described: StreamInfo = {
  stream: 'face',
  source: 'sim:face',
  frame_rate: 30,
  scan: 'progressive',
  stripes: 100,
  camera: { width: 640, height: 480, fx: 800, fy: 800, cx: 319.5, cy: 239.5 },
  projector: { width: 1024, height: 768, fx: 1200, fy: 1200, cx: 511.5, cy: 383.5 },
  projector_from_camera_rotation: [c, 0, s, 0, 1, 0, -s, 0, c],
  projector_from_camera_translation: [-0.25, 0, 0.03],
  stereo_rms_px: 0.2,
  scale_error: 0.002,
};

describe("the rig's part", () => {
  const rig = rigErrorOf(described)!;
  const of = (point: Vec3, sigma: number | null = null): Spot => ({ ...spot(point, sigma), rig });

  it('is what wrong rays make of depth', () => {
    // Both rays in the plane of camera, projector and point (here y = 0), turned at random; where they meet anew.
    let seed = 7;
    const random = (): number => (seed = (seed * 48271) % 2147483647) / 2147483647;
    const normal = (): number => Math.sqrt(-2 * Math.log(random())) * Math.cos(2 * Math.PI * random());
    const [px, , pz] = rig.centre;
    const across = 0.2 * Math.SQRT1_2;
    for (const [x, , z] of [[0, 0, 1], [0.3, 0, 0.8], [-0.4, 0, 2]] as Vec3[]) {
      let squares = 0;
      for (let i = 0; i < 20_000; ++i) {
        const [a, b] = [Math.atan2(x, z) + (normal() * across) / 800, Math.atan2(x - px, z - pz) + (normal() * across) / 1200];
        // t (sin a, cos a) = (px, pz) + u (sin b, cos b)
        const t = (px * Math.cos(b) - pz * Math.sin(b)) / Math.sin(a - b);
        squares += ((t / Math.hypot(x, z) - 1) * z) ** 2; // along the ray; what it moves across is far less
      }
      const told = rigDepthError(rig, [x, 0, z]);
      expect(Math.sqrt(squares / 20_000) / told).toBeGreaterThan(0.95);
      expect(Math.sqrt(squares / 20_000) / told).toBeLessThan(1.05);
    }
  });

  it('is a share of a length', () => {
    const exact = { ...rig, camera: 0, projector: 0 };
    const spots = [[0.1, 0, 1], [0.1, 0.3, 1.4]].map((p) => ({ ...spot(p as Vec3, 0), rig: exact }));
    expect(measure('distance', spots, null, eye)).toMatchObject({ surface: 0, rig: expect.closeTo(0.001, 9), sigma: expect.closeTo(0.001, 9) });
    expect(measure('angle', [...spots, { ...spot([0.5, 0, 1], 0), rig: exact }], null, eye).rig).toBeCloseTo(0, 9); // of any size
    // Rigs of two streams are wrong for themselves.
    const other = measure('distance', [spots[0]!, { ...spots[1]!, stream: 'vase' }], null, eye);
    expect(other.rig).toBeGreaterThan(0.001);
  });

  it('adds to that of the surface as independent errors do', () => {
    const both = measure('distance', [of([0, 0, 1], 3e-4), of([0.2, 0, 1.3], 4e-4)], null, eye);
    expect(both.surface).toBeCloseTo(measure('distance', [spot([0, 0, 1], 3e-4), spot([0.2, 0, 1.3], 4e-4)], null, eye).sigma!, 12);
    expect(both.rig).toBeGreaterThan(both.value * 0.002);
    expect(both.sigma).toBeCloseTo(Math.hypot(both.surface!, both.rig!), 12);
    expect(measure('distance', [of([0, 0, 1]), of([0.2, 0, 1.3])], null, eye)).toMatchObject({ surface: null, sigma: both.rig });
    expect(measure('distance', [of([0, 0, 1], 3e-4), spot([0.2, 0, 1.3], 4e-4)], null, eye)).toMatchObject({ rig: null, sigma: both.surface });
    const depth = measure('point', [of([0, 0, 1], 3e-4)], null, eye);
    expect(depth.sigma).toBeCloseTo(Math.hypot(3e-4, 0.002, rigDepthError(rig, [0, 0, 1])), 9);
  });

  it('is in the heights of a section', () => {
    const [a, b]: [Vec3, Vec3] = [[-0.8, 0, 2.4], [0.8, 0, 2.4]];
    const [without, withRig] = [section(roof, a, b, eye, null), section(roof, a, b, eye, rig)];
    for (const [i, [{ height, sigma, point }]] of withRig.entries()) {
      const part = Math.hypot(rigDepthError(rig, point), 0.002 * height);
      expect(sigma).toBeCloseTo(Math.hypot(without[i]![0].sigma!, part), 6);
    }
  });

  it('is not known where the rig does not say', () => {
    const { stereo_rms_px: _rms, scale_error: _scale, ...silent } = described;
    const { projector: _projector, ...without } = described;
    expect([null, silent, without, { ...described, scale_error: NaN }].map((d) => rigErrorOf(d))).toEqual([null, null, null, null]);
  });
});

describe('section', () => {
  const [a, b]: [Vec3, Vec3] = [[-0.8, 0, 2.4], [0.8, 0, 2.4]];

  it('is the profile of a roof', () => {
    const profile = section(roof, a, b, eye, null);
    for (const [from, to] of profile) {
      for (const p of [from, to]) {
        expect(p.point[1]).toBeCloseTo(0, 6);
        expect(p.along).toBeCloseTo(p.point[0] + 0.8, 6);
        expect(p.height).toBeCloseTo(2.4 - (2 + Math.abs(p.point[0]) / 2), 6); // off the line, to the eye
        expect(p.sigma).toBeGreaterThan(0);
      }
    }
    expect(Math.max(...profile.map(([, to]) => to.height))).toBeCloseTo(0.4, 6);
  });

  it('ends where the line ends', () => {
    expect(section(roof, [-0.8, 0, 2.4], [-0.4, 0, 2.2], eye, null).every(([from]) => from.along < 0.45)).toBe(true);
    expect(section(roof, [-0.8, 3, 2.4], [0.8, 3, 2.4], eye, null)).toEqual([]);
  });

  it('is a table with a point a line', () => {
    const lines = sectionCsv(section(roof, a, b, eye, null)).trim().split('\n');
    expect(lines[0]).toBe('along_m,height_m,sigma_m,x_m,y_m,z_m');
    expect(lines.length).toBe(6); // the roof's four triangles meet: five points
  });
});

it('takes errors of edges and corners whichever way they go', () => {
  const corner = (x: number, errors: Vec3[]): Spot => ({ ...spot([x, 0, 1]), kind: 'corner', errors });
  const m = measure('distance', [corner(0, [[3e-4, 0, 0], [0, 5e-4, 0]]), corner(0.1, [[4e-4, 0, 0], [0, 0, 1e-3]])], null, eye);
  expect(m.sigma).toBeCloseTo(5e-4, 8); // along the length alone
  expect(measure('point', [corner(0, [[1e-3, 0, 3e-4], [0, 0, 4e-4]])], null, eye).sigma).toBeCloseTo(5e-4, 8);
  const lines = measurementsCsv([m]).split('\n').map((line) => line.split(','));
  expect(lines[1]![lines[0]!.indexOf('kind2')]).toBe('corner');
});

describe('text', () => {
  it('has as many digits as are known', () => {
    expect(lengthText(0.1012412, 0.000312)).toBe('101.24 ± 0.31 mm');
    expect(lengthText(0.1012412, 0.0123)).toBe('101 ± 12 mm');
    expect(lengthText(1.5, null)).toBe('1500.00 mm');
    expect(lengthText(1, 0)).toBe('1000.000 ± 0.000 mm');
  });
  it('makes a table', () => {
    const csv = measurementsCsv([measure('distance', [spot([0, 0, 1], 1e-4), spot([0, 0, 2])], null, eye)]);
    const [head, line] = csv.trim().split('\n').map((l) => l.split(','));
    expect(line!.length).toBe(head!.length);
    expect(line!.slice(0, 3)).toEqual(['distance', '1.00000000', 'm']);
    expect(line![head!.indexOf('sigma2_m')]).toBe('');
  });
  it('of a file that is called so has as many columns all the same', () => {
    const of = { ...spot([0, 0, 1]), stream: 'a, the "second".ply' };
    const measured = [measure('point', [of], null, eye)];
    const quoted = '"a, the ""second"".ply"';
    for (const separator of [',', '\t']) {
      const [head, line] = measurementsCsv(measured, separator).split('\n');
      expect(line).toContain(`${separator}${quoted}${separator}`);
      expect(line!.replace(quoted, '').split(separator)).toHaveLength(head!.split(separator).length);
    }
  });
});

it('a section is of what the eye sees: not of what lies behind', () => {
  /** Upright strips of 1 cm side by side, from -half to half, one surface behind the other. */
  function walls(...of: { z: number; half: number }[]): Surface {
    const [positions, triangles]: [number[], number[]] = [[], []];
    for (const { z, half } of of) {
      for (let x = -half; x < half - 1e-9; x += 0.01) {
        const first = positions.length / 3;
        positions.push(x, -1, z, x, 1, z, x + 0.01, -1, z, x + 0.01, 1, z);
        triangles.push(first, first + 1, first + 3, first, first + 3, first + 2);
      }
    }
    return { positions: new Float32Array(positions), coordinates: null, triangles: new Uint32Array(triangles), quality: null };
  }
  const depths = (of: ReturnType<typeof section>): Set<string> => new Set(of.map(([{ point }]) => point[2].toFixed(3)));
  const box = { z: 1, half: 0.1 };
  const [wall, step] = [walls(box, { z: 1.5, half: 1 }), walls(box, { z: 1.005, half: 1 })];
  expect(depths(section(wall, [-0.05, 0, 1], [0.05, 0, 1], eye, null))).toEqual(new Set(['1.000']));
  // Beside the box the wall is seen.
  const beside = section(wall, [0, 0, 1], [0.45, 0, 1.5], eye, null);
  expect(depths(beside)).toEqual(new Set(['1.000', '1.500']));
  for (const [{ point: [x, , z] }] of beside) expect(z < 1.4 || x > 0.14, `${x} of the wall, behind the box`).toBe(true);
  // From anywhere: the box hides what rays to its other side go through.
  for (const from of [[-0.6, 0, 0.2], [0.5, 0, -0.4], [0.04, 0, 0.5]] as Vec3[]) {
    const depthsThere = depths(section(wall, [-0.09, 0, 1], [0.09, 0, 1], from, null));
    expect(depthsThere, String(from)).toEqual(new Set(['1.000']));
    const behind = section(wall, [-0.9, 0, 1.5], [0.9, 0, 1.5], from, null).filter(([{ point }]) => point[2] > 1.4);
    expect(behind.length).toBeGreaterThan(20);
    for (const ends of behind) {
      const x = (ends[0].point[0] + ends[1].point[0]) / 2;
      const atBox = from[0] + ((x - from[0]) * (1 - from[2])) / (1.5 - from[2]);
      expect(Math.abs(atBox) > 0.1 - 1e-6, `${x} of the wall is behind the box, from ${from}`).toBe(true);
    }
    const seen = Array.from({ length: 200 }, (_, i) => -0.995 + i * 0.01).filter((x) => {
      const atBox = from[0] + ((x - from[0]) * (1 - from[2])) / (1.5 - from[2]);
      return Math.abs(x) < 0.9 && Math.abs(atBox) > 0.1;
    });
    expect(Math.abs(new Set(behind.map(([p]) => p.point[0].toFixed(2))).size - seen.length)).toBeLessThan(8); // half strips at the ends, of well over a hundred
  }
  // What is as near as steps and noise of one surface hides nothing.
  expect(depths(section(step, [-0.05, 0, 1], [0.05, 0, 1], eye, null))).toEqual(new Set(['1.000', '1.005']));
});

it('a section is marked where it was clicked, which may be off what was cut', () => {
  const spots = [spot([-0.5, 0, 2.25]), spot([1.5, 0, 3])]; // the second where the surface has ended since
  const m = measure('section', spots, roof, eye);
  const pose = rigidOf([0, 0, 0], [1, 2, 3]);
  const { points, dots } = markOf(m, [pose, pose], '');
  expect(dots).toEqual([[0.5, 2, 5.25], [2.5, 2, 6]]);
  expect(points.length).toBe(2 * m.profile.length);
  expect(dots).not.toContainEqual(points.at(-1));
  expect(markOf({ spots, profile: [] }, [kNowhere, kNowhere], '').points).toEqual(spots.map(({ point }) => point));
});
