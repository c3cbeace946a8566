// SPDX-License-Identifier: Apache-2.0
// Proves: planes and spheres are found exactly, also where a third of the points is of something else; medians, and what
// determines no shape.
import { describe, expect, it } from 'vitest';
import { fitShape, heightOver, medianOf, type ShapeKind } from '../src/shape';

let seed = 7;
const random = (): number => (seed = (seed * 48271) % 2147483647) / 2147483647;
const normal = (): number => Math.sqrt(-2 * Math.log(random())) * Math.cos(2 * Math.PI * random());

/** Points of a shape; `off` of them, as a share, are anywhere before it. */
function points(kind: ShapeKind, count: number, { sigma = 0, off = 0 }): Float32Array {
  const out = new Float32Array(3 * count);
  for (let i = 0; i < count; ++i) {
    const [u, v] = [random() - 0.5, random() - 0.5];
    let p: [number, number, number];
    if (kind === 'plane') p = [u, v, 1 + 0.3 * u - 0.1 * v + sigma * normal()];
    else {
      const r = 0.0866 + sigma * normal();
      const [x, y] = [u / Math.hypot(1, u, v), v / Math.hypot(1, u, v)];
      p = [0.05 + r * x, -0.02 + r * y, 1 - r * Math.sqrt(1 - x * x - y * y)];
    }
    if (random() < off) p[2] -= 0.05 + 0.2 * random();
    out.set(p, 3 * i);
  }
  return out;
}

describe('fitShape', () => {
  it('finds an exact plane, its normal towards the camera', () => {
    const shape = fitShape('plane', points('plane', 500, {}))!;
    const length = Math.hypot(0.3, 0.1, 1);
    [0.3, -0.1, -1].forEach((c, i) => expect(shape.at[i]).toBeCloseTo(c / length, 6));
    expect(shape.size).toBeCloseTo(1 / length, 6);
    expect(heightOver(shape, 0, 0, 0.9)).toBeCloseTo(0.1 / length, 6); // before it
  });

  it('finds an exact sphere', () => {
    const shape = fitShape('sphere', points('sphere', 500, {}))!;
    expect(shape.size).toBeCloseTo(0.0866, 6);
    [0.05, -0.02, 1].forEach((c, i) => expect(shape.at[i]).toBeCloseTo(c, 6));
  });

  it.each<ShapeKind>(['plane', 'sphere'])('leaves out what is of something else: %s', (kind) => {
    const shape = fitShape(kind, points(kind, 6000, { sigma: 1e-5, off: 0.3 }))!;
    expect(Math.abs(shape.size - (kind === 'plane' ? 1 / Math.hypot(0.3, 0.1, 1) : 0.0866))).toBeLessThan(5e-6);
  });

  it('finds none where the points determine none', () => {
    expect(fitShape('plane', new Float32Array(9))).toBeNull();
    expect(fitShape('plane', new Float32Array(300).fill(1))).toBeNull();
    const line = Float32Array.from({ length: 300 }, (_, i) => (i % 3 === 2 ? 1 : i / 100));
    expect(fitShape('sphere', line)).toBeNull();
  });
});

describe('medianOf', () => {
  it('is what sorting gives', () => {
    for (const count of [1, 2, 3, 10, 101, 1000]) {
      const values = Float64Array.from({ length: count }, () => Math.round(20 * random()));
      const sorted = values.slice().sort();
      expect(medianOf(values)).toBe(sorted[count >> 1]);
    }
  });
});
