// SPDX-License-Identifier: Apache-2.0
// Proves: a recording's time runs, stops, repeats and jumps as asked.
import { describe, expect, it } from 'vitest';
import { clockText, frameAt, PlayClock } from '../src/playback';

const times = Float64Array.from({ length: 11 }, (_, i) => i * 100); // a second, ten frames and the last

describe('PlayClock', () => {
  it('runs at its speed and stops at the end', () => {
    const clock = new PlayClock({ times });
    clock.play(1000);
    expect(clock.index(1000)).toBe(0);
    expect(clock.index(1250)).toBe(2);
    expect(clock.untilNext(1250)).toBeCloseTo(50, 9);
    clock.setSpeed(2, 1250);
    expect(clock.position(1350)).toBeCloseTo(450, 9);
    expect(clock.untilNext(1350)).toBeCloseTo(25, 9);
    expect(clock.index(9000)).toBe(10);
    expect(clock.playing).toBe(false);
    expect(clock.untilNext(9000)).toBeNull();
    clock.play(9100); // again from the start
    expect(clock.index(9100)).toBe(0);
  });

  it('stands still while it pauses', () => {
    const clock = new PlayClock({ times });
    clock.play(0);
    clock.pause(320);
    expect(clock.position(5000)).toBeCloseTo(320, 9);
    clock.seek(500, 5000);
    expect(clock.index(6000)).toBe(5);
    clock.play(6000);
    expect(clock.position(6100)).toBeCloseTo(600, 9);
  });

  it('repeats a range', () => {
    const clock = new PlayClock({ times });
    clock.setLoop({ from: 200, to: 500 }, 0);
    clock.seek(200, 0);
    clock.play(0);
    expect(clock.position(250)).toBeCloseTo(450, 9);
    expect(clock.position(400)).toBeCloseTo(300, 9);
    expect(clock.playing).toBe(true);
    clock.setLoop({ from: 500, to: 500 }, 400);
    expect(clock.loop).toBeNull();
  });

  it('keeps its speed within bounds', () => {
    const clock = new PlayClock({ times });
    clock.setSpeed(100, 0);
    expect(clock.speed).toBe(8);
    clock.setSpeed(0, 0);
    expect(clock.speed).toBe(0.1);
  });
});

describe('PlayClock of a live stream', () => {
  it('stays within what is there', () => {
    const live = { times: Float64Array.from([0, 100, 200]) };
    const clock = new PlayClock(live);
    clock.seek(100, 0);
    live.times = Float64Array.from([200, 300, 400]); // what it stood at is gone
    expect(clock.position(50)).toBe(200);
    clock.play(50);
    expect(clock.position(100)).toBeCloseTo(250, 9);
    live.times = Float64Array.from([200, 300, 400, 500, 600]);
    expect(clock.position(400)).toBeCloseTo(550, 9);
    expect(clock.position(600)).toBe(600);
    expect(clock.playing).toBe(false);
    clock.play(700); // at the end: from the oldest there is
    expect(clock.position(700)).toBe(200);
  });
});

describe('frameAt', () => {
  it.each([[-5, 0], [0, 0], [99, 0], [100, 1], [555, 5], [1e9, 10]])('at %d ms: %d', (at, index) =>
    expect(frameAt(times, at)).toBe(index),
  );
});

describe('clockText', () => {
  it.each([[0, '0:00.000'], [61_234, '1:01.234'], [3_723_045, '1:02:03.045']])('%d: %s', (ms, text) =>
    expect(clockText(ms)).toBe(text),
  );
});
