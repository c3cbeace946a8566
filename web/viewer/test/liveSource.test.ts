// SPDX-License-Identifier: Apache-2.0
// Proves: a range of a live stream is repeated for as long as a person wants, also when it would not be kept any more.
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { kHistoryLimits } from '../src/history';
import { LiveSource } from '../src/liveSource';
import type { SourceEvents } from '../src/source';
import { kUtcMs, message, prefix } from './liveFrames';

let received: SourceEvents;
vi.mock('../src/connection', () => ({
  Connection: class {
    readonly connected = true;
    constructor(_stream: string, events: SourceEvents) {
      received = events;
    }
    credit(): void {}
    stop(): void {}
  },
}));

const kEveryMs = 100;
const kKeyEvery = 5;

describe('LiveSource', () => {
  const shown: number[] = []; // sequence numbers
  let source: LiveSource;
  let count = 0; // came so far

  async function live(forMs: number): Promise<void> {
    for (const end = count + forMs / kEveryMs; count < end; ++count) {
      received.frame(prefix(count, count * kEveryMs), message(count % kKeyEvery === 0), false);
      await vi.advanceTimersByTimeAsync(kEveryMs);
    }
  }

  beforeEach(async () => {
    vi.useFakeTimers();
    vi.stubGlobal('window', globalThis);
    count = 0;
    const nonsense = vi.fn();
    source = new LiveSource('face', {
      open: () => undefined,
      lost: () => undefined,
      message: () => undefined,
      clock: () => undefined,
      nonsense,
      frame: ({ sequence }, _message, forLater) => {
        if (forLater) return;
        shown.push(sequence);
        queueMicrotask(() => source.credit());
      },
    });
    await live(10_000);
    // Frames 62 to 70, which build on 60.
    source.pause();
    source.seek(6200);
    source.setLoop({ from: 6200, to: 7000 });
    source.play();
    await live(kHistoryLimits.ms - 10_000);
    shown.length = 0;
  });
  afterEach(() => {
    source.stop();
    vi.useRealTimers();
    vi.unstubAllGlobals();
  });

  const kRange = [62, 63, 64, 65, 66, 67, 68, 69, 70];

  it('goes on repeating a range whose frames would be gone', async () => {
    await live(3 * kHistoryLimits.ms);
    expect([...new Set(shown)].sort((a, b) => a - b)).toEqual(kRange);
    expect(shown.length).toBeGreaterThan(1500);
    const { times, first } = source;
    expect(times[62 - first]).toBe(6200);
    expect(source.loop).toEqual({ from: 6200, to: 7000 });
    expect(source.newestMs).toBe(kUtcMs + (count - 1) * kEveryMs); // though the time line ends before it
    expect(source.kept.spanMs).toBeLessThanOrEqual(kHistoryLimits.ms);
  });

  it('then plays on with what there is, or is live', async () => {
    await live(kHistoryLimits.ms);
    source.setLoop(null);
    const oldest = source.first;
    expect(oldest).toBeGreaterThan(kRange[8]!);
    shown.length = 0;
    await live(1000);
    expect(Math.min(...shown)).toBeGreaterThanOrEqual(oldest);
    source.setLoop({ from: source.position, to: source.position + 1000 });
    await live(2 * kHistoryLimits.ms);
    source.follow();
    expect(source.loop).toBe(null);
    shown.length = 0;
    await live(1000);
    expect(source.live).toBe(true);
    expect(Math.min(...shown)).toBeGreaterThan(count - 13);
  });

  it('goes on repeating it where the server has come to have another clock', async () => {
    received.frame(prefix(count, -3600e3), message(true), false);
    await vi.advanceTimersByTimeAsync(5000);
    expect([...new Set(shown)].sort((a, b) => a - b)).toEqual(kRange);
  });
});
