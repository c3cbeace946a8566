// SPDX-License-Identifier: Apache-2.0
// Proves: a ray meets the surface where geometry says, the nearest first, and says how exactly that is known.
import { describe, expect, it } from 'vitest';
import { coordinatesAt, pick, sigmaAt, type Surface } from '../src/pick';
import { kNoInsets } from '../src/insets';
import { lensOf, pictureRectangle, rigFrustum, rigRay } from '../src/rigCamera';

/** Two squares of 2 m across the axis, at 1 m and 3 m. */
const squares: Surface = {
  positions: new Float32Array([1, 3].flatMap((z) => [-1, -1, z, 1, -1, z, 1, 1, z, -1, 1, z])),
  coordinates: new Float32Array([0, 0, 1, 0, 1, 1, 0, 1, 0, 0, 1, 0, 1, 1, 0, 1]),
  triangles: new Uint32Array([4, 5, 6, 4, 6, 7, 0, 1, 2, 0, 2, 3]),
  quality: { sigmas: new Float32Array([3e-4, 4e-4, 0, 1e-4, 1, 1, 1, 1]), interpolated: new Uint8Array(8) },
};

describe('pick', () => {
  it('finds the nearer of two', () => {
    const picked = pick(squares, [0, 0, 0], [0.25, -0.5, 1])!;
    expect(picked.point).toEqual([0.25, -0.5, 1].map((v) => expect.closeTo(v, 6)));
    expect(coordinatesAt(squares, picked)).toEqual([expect.closeTo(0.625, 6), expect.closeTo(0.25, 6)]);
  });

  it('finds what is behind from behind, and nothing beside', () => {
    expect(pick(squares, [0, 0, 5], [0, 0, -1])!.point[2]).toBeCloseTo(3, 6);
    expect(pick(squares, [0, 0, 0], [1.5, 0, 1])).toBeNull();
    expect(pick(squares, [0, 0, 5], [0, 0, 1])).toBeNull();
  });

  it('finds the nearest point of a cloud that the ray almost meets', () => {
    const cloud: Surface = {
      positions: new Float32Array([0.002, 0, 1, 0, 0, 4, 0.5, 0, 1]),
      coordinates: null,
      triangles: new Uint32Array(0),
      quality: null,
    };
    expect(pick(cloud, [0, 0, 0], [0, 0, 1])!.vertices).toEqual([0]);
    expect(pick(cloud, [0, 0, 0], [0, 0.1, 1])).toBeNull();
    expect(sigmaAt(cloud, pick(cloud, [0, 0, 0], [0, 0, 1])!)).toBeNull();
  });

  it('takes the errors of the vertices as independent', () => {
    const half = pick(squares, [0, 0, 0], [0, -1, 1])!; // on the edge between the first two
    expect(sigmaAt(squares, half)).toBeCloseTo(0.5 * Math.hypot(3e-4, 4e-4), 9);
    expect(sigmaAt(squares, pick(squares, [0, 0, 0], [0.5, 0, 1])!)).toBeNull(); // one is not known
  });
});

describe("the rig's camera", () => {
  const camera = { width: 640, height: 480, fx: 800, fy: 810, cx: 300, cy: 250, distortion: [-0.2, 0.1, 0.001, -0.002, 0] };
  const page = { width: 1000, height: 500 };

  it('shows the whole picture in the middle', () => {
    expect(pictureRectangle(camera, page, kNoInsets)).toEqual({
      x: expect.closeTo(166.667, 3),
      y: expect.closeTo(0, 9),
      width: expect.closeTo(666.667, 3),
      height: expect.closeTo(500, 9),
    });
    const { left, right, top, bottom } = rigFrustum(camera, page, kNoInsets);
    expect(right - left).toBeCloseTo(960 / 800, 9);
    expect(top - bottom).toBeCloseTo(480 / 810, 9);
    expect(left).toBeCloseTo((-160 - 0.5 - 300) / 800, 9);
    expect(top).toBeCloseTo(250.5 / 810, 9);
  });

  it('shows it whole where nothing lies over the page', () => {
    const insets = { top: 60, right: 58, bottom: 140, left: 0 };
    const { x, y, width, height } = pictureRectangle(camera, page, insets);
    expect([width, height]).toEqual([expect.closeTo(400, 9), expect.closeTo(300, 9)]);
    expect([x, y]).toEqual([expect.closeTo((1000 - 58 - 400) / 2, 9), expect.closeTo(60, 9)]);
    const { left, right } = rigFrustum(camera, page, insets);
    expect(right - left).toBeCloseTo((1000 * 640) / 400 / 800, 9);
    const ray = rigRay({ ...camera, distortion: [] }, page, insets, { x: x + (420.5 / 640) * width, y: y + (90.5 / 480) * height })!;
    expect(ray[0]).toBeCloseTo((420 - 300) / 800, 6);
    expect(ray[1]).toBeCloseTo((90 - 250) / 810, 6);
  });

  it('looks along the ray of the pixel under the cursor, through the lens', () => {
    expect(lensOf(camera).distortion).toEqual(camera.distortion);
    const straight = { ...camera, distortion: [0, 0, 0, 0, 0] };
    const scale = 500 / 480;
    const at = { x: 500 / 3 + (420 + 0.5) * scale, y: (90 + 0.5) * scale };
    const ray = rigRay(straight, page, kNoInsets, at)!;
    expect(ray[0]).toBeCloseTo((420 - 300) / 800, 6);
    expect(ray[1]).toBeCloseTo((90 - 250) / 810, 6);
    const bent = rigRay(camera, page, kNoInsets, at)!;
    expect(Math.hypot(bent[0], bent[1])).toBeGreaterThan(Math.hypot(ray[0], ray[1])); // barrel: the corners are drawn in
  });
});
