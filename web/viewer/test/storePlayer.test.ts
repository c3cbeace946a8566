// SPDX-License-Identifier: Apache-2.0
import { describe, expect, it } from 'vitest';
import { framesBefore } from '../src/storePlayer';

const kNothing = { key: -1, last: -1 };

describe('framesBefore', () => {
  it('is nothing for a key frame', () => {
    expect(framesBefore(30, 30, kNothing, false)).toEqual([]);
    expect(framesBefore(30, 30, { key: 0, last: 29 }, true)).toEqual([]);
  });

  it('is the key frame for a grid, once', () => {
    expect(framesBefore(37, 30, kNothing, false)).toEqual([30]);
    expect(framesBefore(38, 30, { key: 30, last: 37 }, false)).toEqual([]);
    expect(framesBefore(33, 30, { key: 30, last: 38 }, false)).toEqual([]);
  });

  it('is all since the key frame for video, less what was decoded in order', () => {
    expect(framesBefore(33, 30, kNothing, true)).toEqual([30, 31, 32]);
    expect(framesBefore(34, 30, { key: 30, last: 33 }, true)).toEqual([]);
    expect(framesBefore(36, 30, { key: 30, last: 33 }, true)).toEqual([34, 35]);
    expect(framesBefore(32, 30, { key: 30, last: 36 }, true)).toEqual([30, 31]);
    expect(framesBefore(33, 30, { key: 60, last: 61 }, true)).toEqual([30, 31, 32]);
  });
});
