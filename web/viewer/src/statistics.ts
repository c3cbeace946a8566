// SPDX-License-Identifier: Apache-2.0
// Figures for the statistics line. Pure: every time is given, in milliseconds.
import type { StreamStatus } from './protocol';

/** Events in a sliding window, for rates. */
export class Rate {
  private events: { at: number; amount: number }[] = [];

  constructor(private readonly windowMs = 2000) {}

  add(at: number, amount = 1): void {
    this.events.push({ at, amount });
    this.trim(at);
  }

  /** A second; over the time since the first event until a window is full. 0 below two events. */
  perSecond(now: number): number {
    this.trim(now);
    const first = this.events[0];
    const last = this.events[this.events.length - 1];
    if (first === undefined || last === undefined || last.at <= first.at) return 0;
    // n events span n - 1 intervals; the oldest only marks the start.
    const amount = this.events.slice(1).reduce((sum, e) => sum + e.amount, 0);
    return (amount * 1000) / (Math.max(last.at, now - this.typicalGap()) - first.at);
  }

  clear(): void {
    this.events = [];
  }

  private typicalGap(): number {
    const n = this.events.length;
    return n < 2 ? 0 : ((this.events[n - 1]!.at - this.events[0]!.at) / (n - 1)) * 1.5;
  }

  private trim(now: number): void {
    let old = 0;
    while (old < this.events.length && this.events[old]!.at < now - this.windowMs) ++old;
    if (old > 0) this.events.splice(0, old);
  }
}

/** Median of the last few values. */
export class RollingMedian {
  private values: number[] = [];

  constructor(private readonly size = 31) {}

  add(value: number): void {
    this.values.push(value);
    if (this.values.length > this.size) this.values.shift();
  }

  /** Null while there is none. */
  get(): number | null {
    if (this.values.length === 0) return null;
    const sorted = [...this.values].sort((a, b) => a - b);
    return sorted[Math.floor(sorted.length / 2)]!;
  }

  clear(): void {
    this.values = [];
  }
}

/** Offset of the server's clock from this one, from the exchange with the shortest round trip. */
export class ClockOffset {
  private samples: { roundTrip: number; offset: number }[] = [];

  add(t0: number, serverMs: number, t1: number): void {
    this.samples.push({ roundTrip: t1 - t0, offset: serverMs - (t0 + t1) / 2 });
    if (this.samples.length > 12) this.samples.shift();
  }

  /** Of another server from now on. */
  clear(): void {
    this.samples = [];
  }

  /** Server time minus local time; null before the first exchange. */
  get(): number | null {
    return this.best()?.offset ?? null;
  }

  /** Of the exchange that tells the offset, which is true to half of it. */
  roundTrip(): number | null {
    return this.best()?.roundTrip ?? null;
  }

  private best(): { roundTrip: number; offset: number } | null {
    let best: { roundTrip: number; offset: number } | null = null;
    for (const sample of this.samples) {
      if (best === null || sample.roundTrip < best.roundTrip) best = sample;
    }
    return best;
  }
}

const kServerDrops = ['drops_capture', 'drops_reconstruct', 'drops_encode', 'drops_publish'] as const;

/** The server counts from its own start; this from when it was first asked. */
export class ServerDrops {
  private before: StreamStatus | null = null;

  restart(): void {
    this.before = null;
  }

  since(status: StreamStatus): StreamStatus {
    const { before } = this;
    const isNewRun = before === null || kServerDrops.some((kind) => status[kind] < before[kind]);
    this.before = isNewRun ? status : before;
    return { ...status, ...Object.fromEntries(kServerDrops.map((kind) => [kind, status[kind] - this.before![kind]])) };
  }
}

/** Where frames were lost on their way to this page. */
export class DropCounter {
  link = 0; // no credit for them: this page or its network is slower than the stream
  gaps = 0; // never reached the gateway
  private last: { sequence: number; drops: number } | null = null;

  /** Forget the last frame: what comes next follows a pause that is no loss. */
  restart(): void {
    this.last = null;
  }

  add(sequence: number, drops: number): void {
    const last = this.last;
    this.last = { sequence, drops };
    if (last === null || sequence <= last.sequence || drops < last.drops) return; // a new run of the stream
    const link = drops - last.drops;
    this.link += link;
    this.gaps += Math.max(0, sequence - last.sequence - 1 - link);
  }
}
