// SPDX-License-Identifier: Apache-2.0
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import type { FrameStore } from '../src/frameStore';
import { Final, Unavailable } from '../src/missing';
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

  describe('of frames that are read over a network', () => {
    /** `answer`: what reading a frame comes to. */
    function playing(answer: { read: () => Promise<void> }): { player: StorePlayer; sent: number[]; complaints: string[]; givenUp: () => number } {
      const [sent, complaints]: [number[], string[]] = [[], []];
      const giveUp = vi.fn();
      const far = { ...store, times: Float64Array.of(0, 1000, 2000, 3000), giveUp, read: async () => (await answer.read(), { prefix, message: new ArrayBuffer(48) }) } as unknown as FrameStore;
      const player = new StorePlayer(far, { frame: () => (sent.push(player.index), player.credit()), nonsense: (why) => complaints.push(why) });
      return { player, sent, complaints, givenUp: () => giveUp.mock.calls.length };
    }
    const kTries = 2100; // ms that a remote file takes for its own
    const refused = (error: Error) => () => new Promise<void>((_, reject) => setTimeout(() => reject(error), kTries));

    it('stands until they come, and goes on from there', async () => {
      let come = (): void => undefined;
      const answer = { read: async (): Promise<void> => undefined };
      const { player, sent } = playing(answer);
      player.play();
      await vi.advanceTimersByTimeAsync(500);
      answer.read = () => new Promise((resolve) => (come = resolve));
      await vi.advanceTimersByTimeAsync(60_000);
      expect(player.missing).toEqual({ why: '', passing: true });
      expect([player.position, player.playing]).toEqual([1000, true]);
      answer.read = async () => undefined;
      come();
      await vi.advanceTimersByTimeAsync(10);
      expect([player.missing, sent]).toEqual([null, [0, 1]]);
      await vi.advanceTimersByTimeAsync(1500);
      expect(sent).toEqual([0, 1, 2]);
      await vi.advanceTimersByTimeAsync(3000);
      expect([sent, player.playing]).toEqual([[0, 1, 2, 3], false]);
    });

    it('asks again for those that may come later, also where it stands still', async () => {
      const answer = { read: refused(new Unavailable('HTTP 503')) };
      const { player, sent, complaints } = playing(answer);
      player.seek(2000);
      await vi.advanceTimersByTimeAsync(20_000);
      expect(player.missing).toEqual({ why: 'HTTP 503', passing: true });
      expect(player.position).toBe(2000);
      player.seek(3000); // elsewhere meanwhile
      player.play();
      player.seek(1000);
      answer.read = async () => undefined;
      await vi.advanceTimersByTimeAsync(200); // not what was asked for before that
      expect([sent[0], player.missing, player.playing, complaints]).toEqual([1, null, true, []]);
    });

    it('gives up what does not come for what somebody goes to, also where that was before it was late', async () => {
      let come = (): void => undefined;
      const answer = { read: async (): Promise<void> => undefined };
      const { player, sent, givenUp } = playing(answer);
      player.seek(0);
      await vi.advanceTimersByTimeAsync(10);
      const hang = (): Promise<void> => new Promise((resolve) => (come = resolve));
      for (const isLate of [true, false]) {
        answer.read = hang;
        player.seek(3000);
        await vi.advanceTimersByTimeAsync(isLate ? 5000 : 100);
        answer.read = async () => undefined;
        player.seek(1000);
        await vi.advanceTimersByTimeAsync(isLate ? 10 : 2000);
        expect([sent, player.missing, givenUp()]).toEqual([[0, 1], null, isLate ? 1 : 2]);
        come(); // after all
        await vi.advanceTimersByTimeAsync(1000);
        expect([sent.splice(1), player.position]).toEqual([[1], 1000]);
      }
      player.seek(2000);
      await vi.advanceTimersByTimeAsync(10);
      expect([sent, givenUp()]).toEqual([[0, 2], 2]);
    });

    it('does not ask all the time for what is refused at once', async () => {
      let asked = 0;
      const answer = { read: (): Promise<void> => (++asked, Promise.reject(new Unavailable('a token is wanted'))) };
      const { player, sent } = playing(answer);
      player.seek(0);
      await vi.advanceTimersByTimeAsync(10_000);
      expect(asked).toBeGreaterThan(2);
      expect(asked).toBeLessThan(20);
      expect(player.missing).toEqual({ why: 'a token is wanted', passing: true });
      answer.read = async () => undefined;
      player.seek(2000); // at once
      await vi.advanceTimersByTimeAsync(10);
      expect([sent, player.missing]).toEqual([[2], null]);
    });

    it('has ended where somebody goes to its end, also before that frame comes', async () => {
      let come = (): void => undefined;
      const { player, sent } = playing({ read: () => new Promise((resolve) => (come = resolve)) });
      player.play();
      await vi.advanceTimersByTimeAsync(2000);
      player.seek(Infinity);
      player.seek(0);
      for (let i = 0; i < 3; ++i) {
        come();
        await vi.advanceTimersByTimeAsync(2000);
      }
      expect([player.position, player.playing, sent.at(-1)]).toEqual([0, false, 0]);
    });

    it('stops at one that never comes, and says why until another has come', async () => {
      const answer = { read: async (): Promise<void> => undefined };
      const { player, sent, complaints } = playing(answer);
      player.play();
      await vi.advanceTimersByTimeAsync(500);
      answer.read = refused(new Final('it has changed'));
      await vi.advanceTimersByTimeAsync(10_000);
      expect(player.missing).toEqual({ why: 'it has changed', passing: false });
      expect([player.playing, complaints]).toEqual([false, ['it has changed']]);
      answer.read = async () => undefined;
      player.seek(0);
      await vi.advanceTimersByTimeAsync(10);
      expect([sent, player.missing]).toEqual([[0, 0], null]);
    });
  });
});
