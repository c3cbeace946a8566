// SPDX-License-Identifier: Apache-2.0
import { expect, test } from 'vitest';
import { buffersOf } from '../src/frameMemory';
import { Spares } from '../src/spares';

test('what is copied lies in memory that was given back, and equals what it was copied from', () => {
  const spares = new Spares();
  const positions = Float32Array.of(1, 2.5, -3);
  const first = spares.copy(positions);
  expect(first).toEqual(positions);
  expect(first.buffer).not.toBe(positions.buffer);
  spares.add([first.buffer]);
  const second = spares.copy(Uint32Array.of(7, 8, 9));
  expect(second).toEqual(Uint32Array.of(7, 8, 9));
  expect(second.buffer).toBe(first.buffer);
  expect(spares.copy(Uint8Array.of(1, 2, 3, 4, 5))).toEqual(Uint8Array.of(1, 2, 3, 4, 5));
});

test('a part of an array is copied alone', () => {
  const whole = Float32Array.of(0, 1, 2, 3);
  expect(new Spares().copy(whole.subarray(1, 3))).toEqual(Float32Array.of(1, 2));
});

test('memory of a large file is not held on to', () => {
  const spares = new Spares();
  const large = new ArrayBuffer(2 ** 26);
  spares.add([large]);
  expect(spares.bytes(2 ** 26 - 8).buffer).not.toBe(large);
});

test('memory that arrays share is named once, and none of empty ones', () => {
  const shared = new ArrayBuffer(24);
  const positions = new Float32Array(shared, 0, 3);
  const triangles = new Uint32Array(shared, 12, 3);
  const none = { coordinates: null, normals: new Float32Array(0), edges: null, rims: null, colours: null };
  const quality = { sigmas: new Float32Array(1), interpolated: new Uint8Array(1) };
  expect(buffersOf({ positions, triangles, quality, ...none })).toEqual([shared, quality.sigmas.buffer, quality.interpolated.buffer]);
});
