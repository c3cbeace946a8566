// SPDX-License-Identifier: Apache-2.0
// Proves: where one rig stands to another is found from places that both see, as exactly as those are.
import { describe, expect, it } from 'vitest';
import type { Vec3 } from '../src/pick';
import { axisOf, inverse, kNowhere, moved, rigidFromPairs, rigidOf, type Rigid } from '../src/rigid';

const kPlaces: Vec3[] = [[-0.2, 0.1, 1], [0.3, 0.05, 1.2], [0.05, -0.25, 0.9], [0.1, 0.2, 1.1]];
const kMotions: [string, Rigid][] = [
  ['nothing', kNowhere],
  ['a step aside', rigidOf([0, 0, 0], [0.7, -0.1, 0.2])],
  ['a camera beside, turned in', rigidOf([0.1, -0.8, 0.05], [0.9, 0.02, 0.3])],
  ['one from behind', rigidOf([0, Math.PI, 0], [0.1, 0, 2.1])],
  ['half a turn about a slant axis', rigidOf([Math.PI / Math.SQRT2, Math.PI / Math.SQRT2, 0], [0, 0.5, 1])],
];
const far = (a: Vec3, b: Vec3): number => Math.hypot(...a.map((c, i) => c - b[i]!));

describe.each(kMotions)('of %s', (_, motion) => {
  it('three places say it', () => {
    const found = rigidFromPairs(kPlaces.slice(0, 3).map((place) => [place, moved(motion, place)]))!;
    expect(found.rms).toBeLessThan(1e-9);
    for (const place of kPlaces) expect(far(moved(found.rigid, place), moved(motion, place))).toBeLessThan(1e-9);
  });
  it('what is wrong with the places is what is left', () => {
    const off: Vec3[] = [[0.001, 0, 0], [0, -0.001, 0], [0, 0, 0.001], [-0.001, 0.001, -0.001]];
    const pairs = kPlaces.map((place, i) => [place, moved(motion, place).map((c, axis) => c + off[i]![axis]!) as Vec3] as const);
    const found = rigidFromPairs(pairs)!;
    expect(found.rms).toBeGreaterThan(2e-4);
    expect(found.rms).toBeLessThan(1.3e-3);
    for (const place of kPlaces) expect(far(moved(found.rigid, place), moved(motion, place))).toBeLessThan(3e-3);
  });
  it('there and back', () => {
    for (const place of kPlaces) expect(far(moved(inverse(motion), moved(motion, place)), place)).toBeLessThan(1e-12);
    const again = rigidOf(axisOf(motion), motion.translation);
    for (const place of kPlaces) expect(far(moved(again, place), moved(motion, place))).toBeLessThan(1e-6);
  });
});

it('is not determined by two places, by one line, or by one place clicked again', () => {
  const pairs = (places: Vec3[]) => places.map((p) => [p, p] as const);
  expect(rigidFromPairs(pairs(kPlaces.slice(0, 2)))).toBeNull();
  expect(rigidFromPairs(pairs([[0, 0, 1], [0.1, 0, 1], [0.3, 0.0001, 1]]))).toBeNull();
  expect(rigidFromPairs(pairs([kPlaces[0]!, kPlaces[0]!, kPlaces[1]!]))).toBeNull();
});
