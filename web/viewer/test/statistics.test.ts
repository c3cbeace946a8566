// SPDX-License-Identifier: Apache-2.0
// Proves: the figures of the statistics line mean what they say.
import { describe, expect, it } from 'vitest';
import type { DecodedFrame } from '../src/messages';
import { Meter } from '../src/meter';
import { ClockOffset, DropCounter, Rate, RollingMedian, ServerDrops } from '../src/statistics';
import { parseFramePrefix, parseServerMessage, type StreamStatus } from '../src/protocol';

describe('Rate', () => {
  it('is events over time', () => {
    const rate = new Rate();
    for (let t = 0; t <= 3000; t += 100) rate.add(t);
    expect(rate.perSecond(3000)).toBeCloseTo(10, 5);
  });
  it('falls when events stop, to nothing after the window', () => {
    const rate = new Rate();
    for (let t = 0; t <= 2000; t += 100) rate.add(t);
    expect(rate.perSecond(2900)).toBeLessThan(9);
    expect(rate.perSecond(5000)).toBe(0);
  });
  it('knows nothing from one event', () => {
    const rate = new Rate();
    rate.add(0);
    expect(rate.perSecond(10)).toBe(0);
  });
});

it('the median forgets and withstands outliers', () => {
  const median = new RollingMedian(3);
  expect(median.get()).toBeNull();
  for (const value of [100, 1, 2, 900]) median.add(value);
  expect(median.get()).toBe(2);
});

it('the clock offset comes from the shortest round trip', () => {
  const clock = new ClockOffset();
  expect(clock.get()).toBeNull();
  clock.add(0, 600, 1000); // 100 off by a slow way back
  clock.add(2000, 2505, 2010); // 500, 10 ms round
  expect(clock.get()).toBe(500);
});

describe('DropCounter', () => {
  it('tells what the gateway dropped from what never came', () => {
    const drops = new DropCounter();
    drops.add(10, 5); // dropped before this page looked: not its business
    drops.add(11, 5);
    drops.add(15, 7); // three missing, two of them dropped at the gateway
    expect([drops.link, drops.gaps]).toEqual([2, 1]);
  });
  it('takes a smaller sequence for a new run', () => {
    const drops = new DropCounter();
    drops.add(100, 0);
    drops.add(0, 0);
    drops.add(1, 0);
    expect([drops.link, drops.gaps]).toEqual([0, 0]);
  });
  it('does not count across a pause', () => {
    const drops = new DropCounter();
    drops.add(1, 0);
    drops.restart();
    drops.add(50, 48);
    expect([drops.link, drops.gaps]).toEqual([0, 0]);
  });
});

describe('ServerDrops', () => {
  const status = (drops: number): StreamStatus => ({ state: 'running', message: '', drops_capture: drops, drops_reconstruct: 7, drops_encode: 0, drops_publish: 0 });
  it('counts from when it was asked first, also of a server that began anew', () => {
    const drops = new ServerDrops();
    const counts = [400, 403, 1, 4].map((n) => drops.since(status(n)));
    expect(counts.map((s) => [s.drops_capture, s.drops_reconstruct])).toEqual([[0, 0], [3, 0], [0, 0], [3, 0]]);
  });
});

describe('Meter', () => {
  const said = (meter: Meter, label: string): string | undefined =>
    meter
      .statistics(0, null)
      .filter((s) => s.label === label)
      .map(({ value, more = '' }) => value + more)[0];
  it('begins to count with each source', () => {
    const meter = new Meter();
    const arrived = (sequence: number): void =>
      meter.arrived({ bytes: 48, sequence, captureMs: 0, publishMs: 0, sentMs: 0, drops: 0 }, new ArrayBuffer(200), 0, true);
    arrived(1);
    arrived(4);
    meter.skipped = 3;
    meter.failed('damaged');
    expect(said(meter, 'drops')).toBe('5 (3 viewer, 2 gaps)');
    expect(said(meter, 'errors')).toBe('1');
    meter.begin();
    expect(said(meter, 'drops')).toBe('0');
    expect(said(meter, 'errors')).toBeUndefined();
  });
  it('knows a latency once the clocks are compared well enough, also of frames before', () => {
    const meter = new Meter();
    const frame = { number: 1, positions: new Float32Array(0), triangles: new Uint32Array(0), decodeMs: 1 } as unknown as DecodedFrame;
    const shown = (captureMs: number): void =>
      meter.shown(frame, { bytes: 48, sequence: 1, captureMs, publishMs: 0, sentMs: 0, drops: 0 }, captureMs + 30, 0, true);
    expect(said(meter, 'latency')).toBe('–');
    meter.clock.add(0, 50, 200); // 50 off by a slow way back
    shown(10_000);
    expect(said(meter, 'latency')).toBe('–'); // no frame is seen before it was taken
    meter.clock.add(5000, 5005, 5010);
    expect(said(meter, 'latency')).toBe('30 ms');
  });
});

describe('messages', () => {
  it('reads a frame prefix', () => {
    const bytes = new ArrayBuffer(60);
    const view = new DataView(bytes);
    view.setUint32(0, 48, true);
    view.setBigUint64(8, 12n, true);
    view.setBigInt64(16, 1_700_000_000_123_456_789n, true);
    view.setBigUint64(40, 3n, true);
    const prefix = parseFramePrefix(bytes);
    expect(prefix).toMatchObject({ bytes: 48, sequence: 12, drops: 3 });
    expect(prefix.captureMs).toBeCloseTo(1_700_000_000_123.456, 2);
  });
  it('refuses a short or lying prefix', () => {
    expect(() => parseFramePrefix(new ArrayBuffer(47))).toThrow(/prefix/);
    const bytes = new ArrayBuffer(60);
    new DataView(bytes).setUint32(0, 61, true);
    expect(() => parseFramePrefix(bytes)).toThrow(/prefix/);
  });
  it('ignores types it does not know and refuses what is none', () => {
    expect(parseServerMessage('{"type":"later"}')).toBeNull();
    expect(parseServerMessage('{"type":"gone"}')).toEqual({ type: 'gone' });
    expect(() => parseServerMessage('{}')).toThrow();
    expect(() => parseServerMessage('null')).toThrow();
    expect(() => parseServerMessage('{')).toThrow();
  });
});
