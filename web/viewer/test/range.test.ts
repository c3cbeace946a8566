// SPDX-License-Identifier: Apache-2.0
// Proves: a range has the frames that are seen in it, described as they were, and a ZIP file no more than it may.
import { describe, expect, it, vi } from 'vitest';
import { writeStreamInfo } from '../src/cdrWriter';
import type { FrameStore } from '../src/frameStore';
import { History } from '../src/history';
import { bytesOf } from '../src/mcap';
import type { DecodedFrame } from '../src/messages';
import { exportRange } from '../src/rangeExport';
import { FrameNames, framesBetween } from '../src/rangeFrames';
import { Recording } from '../src/recording';
import { ZipWriter } from '../src/zip';
import { kInfo } from './streamInfo';

const kEmpty: Omit<DecodedFrame, 'id' | 'number'> = {
  type: 'frame',
  positions: new Float32Array(),
  coordinates: null,
  normals: null,
  triangles: new Uint32Array(),
  edges: null,
  quality: null,
  texture: null,
  notice: null,
  extent: null,
  decodeMs: 0,
};

/** A decoder that finds nothing in any frame. */
vi.mock('../src/workers', () => ({
  startDecoder: () => {
    const worker = {
      onmessage: (_: { data: DecodedFrame }): void => undefined,
      postMessage: ({ id }: { id: number }) => queueMicrotask(() => worker.onmessage({ data: { ...kEmpty, id, number: id } })),
      terminate: () => undefined,
    };
    return worker;
  },
}));

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

describe('FrameNames', () => {
  const names = (...numbers: number[]): string[] => {
    const given = new FrameNames();
    return numbers.map((number, i) => given.name(number, numbers[i + 1] ?? null));
  };

  it('are after the cameras frame, of whose two surfaces the first is the one between', () => {
    expect(names(1, 2, 4)).toEqual(['000001', '000002', '000004']);
    expect(names(1, 2, 2, 3, 4)).toEqual(['000001', '000002_between', '000002', '000003', '000004']);
  });

  it('tell numbers that start again apart', () => {
    expect(names(1, 2, 1, 2, 3, 1)).toEqual(['000001', '000002', '000001-2', '000002-2', '000003', '000001-3']);
    expect(names(1, 1, 1, 1)).toEqual(['000001_between', '000001', '000001_between-2', '000001-2']);
  });
});

describe('a range of a live stream', () => {
  /** A whole message: a key frame without vertices, published at so many seconds. */
  function message(seconds: number): ArrayBuffer {
    const view = new DataView(new ArrayBuffer(48 + 64 + 8 + 1));
    view.setUint32(0, 48, true);
    view.setBigUint64(8, BigInt(seconds), true);
    for (const at of [16, 24, 32]) view.setBigInt64(at, BigInt(seconds) * 1_000_000_000n, true);
    new Uint8Array(view.buffer).set([0x52, 0x4c, 0x56, 0x46, 1, 1, 72, 0], 48);
    view.setUint32(48 + 40, 1, true); // vertices
    new Uint8Array(view.buffer).set([1, 8, 64, 0], 48 + 56);
    new Uint8Array(view.buffer).set([1, 2, 0, 0, 1], 48 + 64); // a grid
    return view.buffer;
  }

  function sixFrames(): FrameStore {
    const history = new History({ ms: 1e9, bytes: 1e9 }, 'face');
    for (let i = 0; i < 6; ++i) {
      if (i % 3 === 0) history.info = { ...kInfo, stripes: 3, source: `sim:${i}` }; // a server that was started again
      const ms = (1000 + i) * 1000;
      const kept = history.add({ bytes: 48, sequence: i, captureMs: ms, publishMs: ms, sentMs: ms, drops: 0 }, message(1000 + i));
      expect(kept).not.toBeNull();
    }
    return history.held();
  }

  it('is read once, with the frame behind it', async () => {
    vi.stubGlobal('window', globalThis);
    const store = sixFrames();
    const read = vi.spyOn(store, 'read');
    const order = { store, range: [1, 3] as const, description: null, progress: () => undefined, cancelled: new AbortController().signal };
    expect((await exportRange({ ...order, format: 'ply' })).frames).toBe(3);
    expect(read.mock.calls.map(([index]) => index)).toEqual([1, 2, 3, 4]);
  });

  it('is described as its frames were when they came', async () => {
    const store = sixFrames();
    const sources = async (range: [number, number]): Promise<(string | undefined)[]> => {
      const order = { store, range, format: 'mcap' as const, description: writeStreamInfo({ ...kInfo, source: 'now' }) };
      const { content, frames } = await exportRange({ ...order, progress: () => undefined, cancelled: new AbortController().signal });
      const recording = await Recording.open(bytesOf(content));
      return Array.from({ length: frames }, (_, i) => recording.infoAt((1000 + range[0] + i) * 1000)?.source);
    };
    expect(await sources([0, 1])).toEqual(['sim:0', 'sim:0']);
    expect(await sources([1, 4])).toEqual(['sim:0', 'sim:0', 'sim:3', 'sim:3']);
  });
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
