// SPDX-License-Identifier: Apache-2.0
// Proves: what `relievo export --format animation` writes plays in three.js, whose loader knows nothing of it.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { AnimationMixer } from 'three';
import { GLTFLoader } from 'three/examples/jsm/loaders/GLTFLoader.js';
import { expect, it } from 'vitest';

it('an exported animation shows each frame from its time to that of the next', async () => {
  const bytes = readFileSync(join(__dirname, '../../../tests/conformance/animation/small.glb'));
  const { scene, animations } = await new GLTFLoader().parseAsync(new Uint8Array(bytes).buffer, '');
  expect(animations.length).toBe(1);
  expect(animations[0]!.duration).toBeCloseTo(0.4);
  const mixer = new AnimationMixer(scene);
  mixer.clipAction(animations[0]!).play();
  const shown = (time: number): number[] => {
    mixer.setTime(time);
    return scene.children.filter((node) => node.scale.x === 1 && node.scale.y === 1 && node.scale.z === 1).map((node) => {
      return node.userData.frame as number;
    });
  };
  const stays = scene.children.map((node) => node.scale.x);
  expect(stays, 'a viewer that does not animate').toEqual([1, 0]);
  expect(shown(0)).toEqual([10]);
  expect(shown(0.099)).toEqual([10]);
  expect(shown(0.101), 'an empty frame').toEqual([]);
  expect(shown(0.249)).toEqual([]);
  expect(shown(0.251)).toEqual([12]);
  expect(shown(0.399)).toEqual([12]);
  expect(shown(0.45), 'again').toEqual([10]);
});
