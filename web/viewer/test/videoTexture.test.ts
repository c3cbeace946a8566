// SPDX-License-Identifier: Apache-2.0
import { expect, test } from 'vitest';
import { parseFrame } from '../src/frame';
import { codecName, videoTextureIsKey, VideoTextures } from '../src/videoTexture';

const kKey = [0, 0, 0, 0, 0, 0, 0, 1, 0x67, 0x64, 0x00, 0x1e, 0xac, 0, 0, 0, 1, 0x68, 0xee, 0, 0, 0, 1, 0x65, 0x88];
const kDelta = [1, 2, 3, 4, 0, 0, 0, 1, 0x41, 0x9a, 7];

/** A frame without geometry and with this H.264 texture. */
function frameWith(texture: number[], flags: number): Uint8Array {
  const bytes = new Uint8Array(80 + texture.length);
  const view = new DataView(bytes.buffer);
  bytes.set([0x52, 0x4c, 0x56, 0x46, 1, flags, 80, 0]);
  view.setUint32(48, 64, true);
  view.setUint32(52, 48, true);
  bytes.set([2, 8, 64, 0], 56);
  bytes.set([1, 2, 1, 0], 64); // an empty grid
  bytes.set([2, 4], 72);
  view.setUint32(76, texture.length, true);
  bytes.set(texture, 80);
  return bytes;
}

test('a section says whether it builds on another', () => {
  expect(videoTextureIsKey(new Uint8Array(kKey))).toBe(true);
  expect(videoTextureIsKey(new Uint8Array(kDelta))).toBe(false);
  expect(videoTextureIsKey(new Uint8Array(4))).toBe(false);
  expect(videoTextureIsKey(new Uint8Array(0))).toBe(false);
});

test('the codec is named after profile, constraints and level', () => {
  expect(codecName(new Uint8Array(kKey).subarray(4))).toBe('avc1.64001e');
  expect(() => codecName(new Uint8Array(kDelta).subarray(4))).toThrow('no parameter sets');
});

test('frame and texture must agree on the key', () => {
  expect(parseFrame(frameWith(kKey, 1)).isKey).toBe(true);
  expect(parseFrame(frameWith(kDelta, 0)).isKey).toBe(false);
  expect(() => parseFrame(frameWith(kDelta, 1))).toThrow('do not agree');
});

test('a picture that builds on another is not decoded without it', async () => {
  expect(VideoTextures.possible).toBe(false); // in node
  await expect(new VideoTextures().decode(new Uint8Array(kDelta), 64, 48)).rejects.toThrow('not received');
  await expect(new VideoTextures().decode(new Uint8Array(3), 64, 48)).rejects.toThrow('cut short');
});
