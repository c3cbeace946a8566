// SPDX-License-Identifier: Apache-2.0
// Proves: the first view shows all of the surface, or of what stands apart before it, within what is free of the page.
import { expect, it } from 'vitest';
import * as THREE from 'three';
import { firstView, Framing } from '../src/firstView';
import type { Box } from '../src/surface';

/** The largest share of the free sides that a corner of the box takes. */
function share({ min, max }: Box, right: number, up: number, view: ReturnType<typeof firstView>): number {
  const camera = new THREE.PerspectiveCamera();
  camera.position.set(...view.position);
  camera.lookAt(...view.target);
  camera.updateMatrixWorld();
  let most = 0;
  for (const x of [min[0], max[0]]) {
    for (const y of [min[1], max[1]]) {
      for (const z of [min[2], max[2]]) {
        const at = new THREE.Vector3(x, -y, -z).applyMatrix4(camera.matrixWorldInverse);
        most = Math.max(most, Math.abs(at.x / at.z) / right, Math.abs(at.y / at.z) / up);
      }
    }
  }
  return most;
}

const wall: Box = { min: [-1, -0.8, 0.9], max: [1, 0.8, 1.5] };
const person: Box = { min: [-0.2, -0.4, 0.9], max: [0.3, 0.4, 1.1] };

it.each([
  [0.4, 0.3],
  [0.12, 0.25],
  [0.5, 0.1],
])('with tangents of %d and %d all is seen, and large', (right, up) => {
  for (const [extent, box] of [
    [{ ...wall, centre: [0, 0, 1.4] }, wall],
    [{ ...wall, centre: [0, 0, 1.4], subject: person }, person],
  ] as const) {
    const taken = share(box, right, up, firstView(extent as Parameters<typeof firstView>[0], right, up));
    expect(taken).toBeLessThan(1.05); // a box's corners are further out than what is in it
    expect(taken).toBeGreaterThan(0.6);
  }
});

it('is of the subject, or of all, from when it was chosen on, whatever comes and goes', () => {
  const wall = { min: [-2, -1, 3] as [number, number, number], max: [2, 1, 3.2] as [number, number, number], centre: [0, 0, 3.1] as [number, number, number], depths: [3, 3.2] as [number, number] };
  const person = { min: [-0.4, -0.9, 1] as [number, number, number], max: [0.4, 0.9, 1.4] as [number, number, number] };
  const both = { ...wall, subject: person };
  const framing = new Framing();
  framing.choose(both);
  expect(framing.frame(both).subject).toEqual(person);
  expect(framing.frame(wall).subject, 'it is not told apart for a moment').toEqual(person);
  framing.choose(wall);
  expect(framing.frame(wall).subject).toBeUndefined();
  expect(framing.frame(both).subject, 'someone walked in').toBeUndefined();
  framing.choose(both);
  expect(framing.frame(both).subject).toEqual(person);
});
