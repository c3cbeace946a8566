// SPDX-License-Identifier: Apache-2.0
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import type { FrameStore } from '../src/frameStore';
import { framesBefore, StorePlayer } from '../src/storePlayer';

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

describe('StorePlayer', () => {
  beforeEach(() => {
    vi.useFakeTimers();
    vi.stubGlobal('window', globalThis);
  });
  afterEach(() => {
    vi.useRealTimers();
    vi.unstubAllGlobals();
  });

  const prefix = { bytes: 48, sequence: 0, captureMs: 0, publishMs: 0, sentMs: 0, drops: 0 };
  const store = {
    times: Float64Array.of(0, 100, 200),
    first: 0,
    keyBefore: async (index: number) => index,
    buildsOnFrameBefore: async () => false,
    read: async () => ({ prefix, message: new ArrayBuffer(48) }),
  } as unknown as FrameStore;

  it('tells frames that it played one after the other from such that somebody went to', async () => {
    const sent: [number, number][] = []; // index and run
    const player = new StorePlayer(store, { frame: () => void sent.push([player.index, player.run]), nonsense: () => undefined });
    const runs = async (act: () => void): Promise<number[]> => {
      act();
      await vi.advanceTimersByTimeAsync(50);
      player.credit();
      await vi.advanceTimersByTimeAsync(50);
      return sent.splice(0).map(([, run]) => run);
    };
    const [begun] = await runs(() => player.play());
    expect(await runs(() => undefined)).toEqual([begun]); // frame 1
    player.pause();
    player.credit(-1); // its last frame is still under way
    player.step(1);
    expect(sent).toEqual([]);
    const [stepped] = await runs(() => undefined);
    expect(stepped).not.toBe(begun);
    expect(await runs(() => player.step(-1))).not.toContain(stepped);
  });

  it('has not played to the end where somebody went back at that moment', async () => {
    const ends: number[] = []; // where it was
    const player = new StorePlayer(store, { frame: () => player.credit(), nonsense: () => undefined, ended: () => ends.push(player.position) });
    player.play();
    await vi.advanceTimersByTimeAsync(199);
    vi.spyOn(performance, 'now').mockReturnValue(performance.now() + 10); // the player's timer is late
    expect(player.position).toBe(200); // as the time line asks
    player.seek(0);
    await vi.advanceTimersByTimeAsync(1000);
    expect(player.playing).toBe(false);
    expect(ends).toEqual([]);

    vi.restoreAllMocks();
    player.play();
    await vi.advanceTimersByTimeAsync(1000);
    expect(ends).toEqual([200]);
  });

  it('waits for a frame of months later without looking for it all the time', async () => {
    const far = { ...store, times: Float64Array.of(0, 100 * 24 * 3_600_000) } as FrameStore;
    const player = new StorePlayer(far, { frame: () => player.credit(), nonsense: () => undefined });
    player.play();
    await vi.advanceTimersByTimeAsync(1);
    let looks = 0;
    player.changed = () => ++looks;
    const timers = vi.spyOn(window, 'setTimeout');
    player.setSpeed(0.1);
    await vi.advanceTimersByTimeAsync(1000);
    expect(looks).toBeLessThan(5);
    for (const [, wait] of timers.mock.calls) expect(wait).toBeLessThan(2 ** 31); // which browsers take for none
    player.stop();
  });
});
