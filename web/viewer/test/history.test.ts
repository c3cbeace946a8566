// SPDX-License-Identifier: Apache-2.0
// Proves: what is kept of a live stream is bounded, begins with a key frame, and is given back as it came.
import { describe, expect, it } from 'vitest';
import { History } from '../src/history';
import { kUtcMs, message, prefix } from './liveFrames';

const kKeyEvery = 5;
function filled(count: number, limits: { ms: number; bytes: number }): History {
  const history = new History(limits);
  for (let i = 0; i < count; ++i) history.add(prefix(i, i * 100), message(i % kKeyEvery === 0));
  return history;
}
const kWide = { ms: 1e9, bytes: 1e9 };

describe('History', () => {
  it('holds what there is now, while it goes on without it', async () => {
    const history = filled(20, { ms: 1000, bytes: 1e9 });
    const held = history.held();
    const [times, first] = [[...held.times], held.first];
    for (let i = 20; i < 60; ++i) history.add(prefix(i, i * 100), message(i % kKeyEvery === 0));
    expect(history.first).toBeGreaterThan(first);
    expect([...held.times]).toEqual(times);
    expect((await held.read(first)).prefix.sequence).toBe(first);
    await expect(history.read(first)).rejects.toThrow('no longer kept');
  });

  it('gives back what came, as often as asked', async () => {
    const history = filled(12, kWide);
    expect([...history.times]).toEqual(Array.from({ length: 12 }, (_, i) => i * 100));
    expect(history.startMs).toBe(kUtcMs);
    expect(history.isKey(5)).toBe(true);
    expect(history.isKey(6)).toBe(false);
    expect(await history.keyBefore(9)).toBe(5);
    expect(await history.buildsOnFrameBefore(9)).toBe(false);
    const [one, two] = [await history.read(7), await history.read(7)];
    expect(one.prefix.sequence).toBe(7);
    expect(new Uint8Array(one.message)).toEqual(new Uint8Array(message(false)));
    expect(two.message).not.toBe(one.message);
  });

  it('keeps no more than it may, and begins with a key frame', async () => {
    const byTime = filled(100, { ms: 2000, bytes: 1e9 });
    expect(byTime.spanMs).toBeLessThanOrEqual(2000);
    expect(byTime.spanMs).toBeGreaterThan(1400);
    expect(byTime.end).toBe(100); // indices stay
    expect(byTime.isKey(byTime.first)).toBe(true);
    expect((await byTime.read(99)).prefix.sequence).toBe(99);
    await expect(byTime.read(byTime.first - 1)).rejects.toThrow('no longer');
    const size = message(true).byteLength;
    const byBytes = filled(100, { ms: 1e9, bytes: 10 * size });
    expect(byBytes.bytes).toBe(byBytes.times.length * size);
    expect(byBytes.times.length).toBeLessThanOrEqual(10);
    expect(byBytes.times.length).toBeGreaterThan(5);
  });

  it('counts what is missing, and takes nothing twice', () => {
    const history = filled(6, kWide);
    history.add(prefix(5, 500), message(true)); // again after a connection was lost
    history.add(prefix(9, 900), message(false));
    expect(history.times.length).toBe(7);
    expect(history.gapBefore(6)).toBe(3);
    expect(history.gapBefore(5)).toBe(0);
  });

  it('begins anew with another clock, and with nothing that builds on what is not there', () => {
    const history = filled(6, kWide);
    history.add(prefix(6, -60_000), message(false));
    expect(history.times.length).toBe(0);
    history.add(prefix(7, -59_900), message(true));
    expect([...history.times]).toEqual([0]);
    expect(history.first).toBe(6);
    expect(history.isKey(6)).toBe(true);
  });

  it('leaves out what is no frame', () => {
    const history = filled(1, kWide);
    history.add(prefix(1, 100), new ArrayBuffer(60));
    expect(history.times.length).toBe(1);
  });

  it('takes the time of publishing where frames carry the time of a take', () => {
    const history = new History(kWide);
    history.add({ ...prefix(0, 0), captureMs: 0 }, message(true));
    history.add({ ...prefix(1, 100), captureMs: 33 }, message(false));
    expect([...history.times]).toEqual([0, 100]);
  });
});
