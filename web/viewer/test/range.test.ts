// SPDX-License-Identifier: Apache-2.0
// Proves: a range has the frames that are seen in it, and a ZIP file no more than it may.
import { describe, expect, it } from 'vitest';
import { framesBetween } from '../src/rangeFrames';
import { ZipWriter } from '../src/zip';

describe('framesBetween', () => {
  const store = { times: Float64Array.from([0, 100, 200, 300]), first: 7 };
  it.each([
    [0, 300, [7, 10]],
    [-50, 1e9, [7, 10]],
    [100, 200, [8, 9]],
    [150, 250, [8, 9]], // what was on the screen then
    [210, 220, [9, 9]],
  ])('%d to %d', (from, to, wanted) => expect(framesBetween(store, from, to)).toEqual(wanted));
});

describe('ZipWriter', () => {
  it('adds no file that makes it too large', () => {
    const zip = new ZipWriter(4 * 100);
    expect(zip.add('a', new Uint8Array(200))).toBe(true);
    expect(zip.add('b', new Uint8Array(200))).toBe(false);
    expect(zip.add('c', Uint8Array.of(2, 3))).toBe(true);
    expect(zip.finish().size).toBe(2 * (30 + 46 + 2) + 202 + 22);
  });
});
