// SPDX-License-Identifier: Apache-2.0
// Proves: normals point to the viewer of a counter-clockwise triangle, edges are whole, outliers do not move the view.
import { expect, it } from 'vitest';
import { robustExtent, triangleEdges, vertexNormals } from '../src/surface';

it('normals of a triangle that faces the camera point to the camera', () => {
  // Camera frame: x right, y down, z forward. Counter-clockwise as the camera sees it: right, up, left.
  const normals = vertexNormals(new Float32Array([1, 0, 2, 0, -1, 2, -1, 0, 2]), new Uint32Array([0, 1, 2]));
  for (let v = 0; v < 3; ++v) expect([...normals.slice(v * 3, v * 3 + 3)].map((x) => x + 0)).toEqual([0, 0, -1]);
});

it('a vertex of no triangle gets a normal too', () => {
  expect([...vertexNormals(new Float32Array([5, 5, 5]), new Uint32Array(0))]).toEqual([0, 0, -1]);
});

it('three edges a triangle', () => {
  expect([...triangleEdges(new Uint32Array([4, 5, 6]))]).toEqual([4, 5, 5, 6, 6, 4]);
});

it('a few outliers do not move the box', () => {
  const positions = new Float32Array(3000);
  for (let v = 0; v < 1000; ++v) positions.set([v / 1000, 0, 1], v * 3);
  positions.set([900, -900, 900], 0);
  const extent = robustExtent(positions);
  expect(extent?.max[0]).toBeLessThan(1);
  expect(extent?.max[2]).toBe(1);
  expect(extent?.centre[0]).toBeCloseTo(0.5, 1);
  expect(robustExtent(new Float32Array(30))).toBeNull();
});

it('what stands apart before the rest is the subject', () => {
  // A plate of 0.4 m at 1 m before a wall of 2 m at 1.5 m, and a few points that fly between them.
  const positions = new Float32Array(3 * 4000);
  for (let v = 0; v < 4000; ++v) {
    const [x, y] = [((v % 63) / 62 - 0.5) * 2, (Math.floor(v / 63) / 62 - 0.5) * 2];
    const [size, z] = v % 4 === 0 ? [0.2, 1 + 0.02 * x] : [1, 1.5];
    positions.set([x * size + (size < 1 ? 0.3 : 0), y * size, z], v * 3);
    if (v % 500 === 1) positions[v * 3 + 2] = 1.1 + v / 20000;
  }
  const extent = robustExtent(positions)!;
  expect(extent.max[2]).toBeCloseTo(1.5, 6);
  expect(extent.max[0]).toBeGreaterThan(0.9);
  expect(extent.subject!.min[0]).toBeCloseTo(0.1, 1);
  expect(extent.subject!.max[0]).toBeCloseTo(0.5, 1);
  expect(extent.subject!.max[2]).toBeLessThan(1.1);

  for (let v = 0; v < 4000; ++v) positions[v * 3 + 2] = 1 + v / 8000; // of all depths: one surface
  expect(robustExtent(positions)!.subject).toBeUndefined();
  positions.fill(1);
  expect(robustExtent(positions)!.subject).toBeUndefined();
});

it('depths are of who stands at the side, too, and not of what flies', () => {
  const positions = new Float32Array(3 * 4000);
  for (let v = 0; v < 4000; ++v) positions.set([v / 4000, 0, v % 400 === 2 ? 2.2 : v % 1000 === 6 ? 0.4 : 3.7], v * 3);
  const { min, depths } = robustExtent(positions)!;
  expect(min[2]).toBeCloseTo(3.7, 6); // the first view stays that of the wall
  expect(depths[0]).toBeCloseTo(2.2, 6);
  expect(depths[1]).toBeCloseTo(3.7, 6);
});

it('normals average the noise of single lines away', () => {
  // A plane of 40 lines, every second one 1 mm nearer: lines 2 mm apart, columns 10 mm.
  const [rows, columns] = [40, 10];
  const positions: number[] = [];
  const triangles: number[] = [];
  for (let r = 0; r < rows; ++r) {
    for (let c = 0; c < columns; ++c) {
      positions.push(c * 0.01, r * 0.002, 1 - (r % 2) * 0.001);
      if (r === 0 || c === 0) continue;
      const at = (row: number, column: number): number => row * columns + column;
      triangles.push(at(r - 1, c - 1), at(r, c - 1), at(r, c), at(r - 1, c - 1), at(r, c), at(r - 1, c));
    }
  }
  const mesh = [new Float32Array(positions), new Uint32Array(triangles)] as const;
  const tilt = (normals: Float32Array): number => {
    let worst = 0;
    for (let r = 8; r < rows - 8; ++r) worst = Math.max(worst, Math.abs(normals[(r * columns + 5) * 3 + 1]!));
    return worst;
  };
  expect(tilt(vertexNormals(...mesh))).toBeLessThan(0.5 * tilt(vertexNormals(...mesh, 0)) + 0.01);
  expect(vertexNormals(...mesh)[(20 * columns + 5) * 3 + 2]).toBeLessThan(-0.99);
});
