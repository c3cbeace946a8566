// SPDX-License-Identifier: Apache-2.0
// Gathers what the statistics line says.
import { Journal } from './journal';
import type { DecodedFrame } from './messages';
import type { FramePrefix, StreamStatus } from './protocol';
import { ClockOffset, DropCounter, Rate, RollingMedian } from './statistics';
import { text } from './strings';
import type { Statistic } from './ui';

// Older than this, a frame is from a recording and its age is no latency.
const kLiveMs = 60_000;

export class Meter {
  readonly clock = new ClockOffset();
  readonly journal = new Journal();
  skipped = 0; // decoded here, replaced before they were drawn
  private drops = new DropCounter();
  private readonly frames = new Rate();
  private readonly bytes = new Rate();
  private readonly ages = new RollingMedian(); // by this machine's clock, however far it is off
  private readonly decode = new RollingMedian();
  private received = 0;
  private shownFrames = 0;
  private errors = 0;
  private before = { skipped: 0, errors: 0 }; // of other sources
  private lastError = '';
  private number = 0;
  private sequence = 0;
  private vertices = 0;
  private triangles = 0;

  /** Of another source from now on. */
  begin(): void {
    this.restart();
    this.clock.clear();
    this.drops = new DropCounter();
    this.before = { skipped: this.skipped, errors: this.errors };
  }

  /** A new connection or stream. */
  restart(): void {
    this.drops.restart();
    this.frames.clear();
    this.bytes.clear();
    this.ages.clear();
    this.journal.clear();
  }

  /** The page was hidden or shown again, or left what is live: frames it did not ask for meanwhile are no losses. */
  pause(): void {
    this.restart();
  }

  /** Over the network. */
  came(bytes: number, now: number): void {
    this.bytes.add(now, bytes);
  }

  /** `live`: what is missing before it was lost, and its age is a latency. */
  arrived(prefix: FramePrefix, message: ArrayBuffer, now: number, live: boolean): void {
    ++this.received;
    this.journal.arrived(prefix, message, performance.timeOrigin + now);
    if (live) this.drops.add(prefix.sequence, prefix.drops);
  }

  decoded(prefix: FramePrefix, utcMs: number): void {
    this.journal.decoded(prefix, utcMs);
  }

  shown(frame: DecodedFrame, prefix: FramePrefix, utcMs: number, now: number, live: boolean): void {
    ++this.shownFrames;
    this.number = frame.number;
    this.sequence = prefix.sequence;
    this.vertices = frame.positions.length / 3;
    this.triangles = frame.triangles.length / 3;
    this.decode.add(frame.decodeMs);
    this.frames.add(now);
    const offset = this.clock.get();
    if (offset === null || !live) return;
    this.journal.shown(prefix, utcMs, offset);
    const age = utcMs + offset - prefix.captureMs;
    if (age > -1000 && age < kLiveMs) this.ages.add(utcMs - prefix.captureMs);
    else this.ages.clear();
  }

  /** From the exposure to the drawing, median; null while unknown, as where the clocks are compared too roughly yet to have it above 0. */
  private latency(): number | null {
    const [age, offset] = [this.ages.get(), this.clock.get()];
    return age === null || offset === null || age + offset < 0 ? null : age + offset;
  }

  failed(message: string): void {
    ++this.errors;
    this.lastError = message;
  }

  figures(now: number): { rate: number; bits: number; vertices: number; triangles: number; decodeMs: number | null; drops: { link: number; viewer: number; gaps: number } } {
    const { link, gaps } = this.drops;
    return {
      rate: this.frames.perSecond(now),
      bits: this.bytes.perSecond(now) * 8,
      vertices: this.vertices,
      triangles: this.triangles,
      decodeMs: this.decode.get(),
      drops: { link, viewer: this.skipped - this.before.skipped, gaps },
    };
  }

  report(): Record<string, unknown> {
    return {
      frame: this.number,
      sequence: this.sequence,
      received: this.received,
      shown: this.shownFrames,
      errors: this.errors,
      lastError: this.lastError,
      drops: { link: this.drops.link, gaps: this.drops.gaps, viewer: this.skipped },
      vertices: this.vertices,
      triangles: this.triangles,
      latencyMs: this.latency(),
      decodeMs: this.decode.get(),
      parts: this.journal.parts,
      stages: this.journal.medians(),
    };
  }

  statistics(now: number, status: StreamStatus | null): Statistic[] {
    const server = status
      ? status.drops_capture + status.drops_reconstruct + status.drops_encode + status.drops_publish
      : 0;
    const { link, gaps } = this.drops;
    const viewer = this.skipped - this.before.skipped;
    const errors = this.errors - this.before.errors;
    const total = server + link + gaps + viewer;
    const places = [
      [server, 'server'],
      [link, 'link'],
      [viewer, 'viewer'],
      [gaps, 'gaps'],
    ].flatMap(([count, place]) => (count === 0 ? [] : [`${count} ${place}`]));
    const latency = this.latency();
    const say = text.badge;
    const statistics: Statistic[] = [
      { label: say.frame[0], value: String(this.number), title: say.frame[1] },
      {
        label: say.rate[0],
        value: `${this.frames.perSecond(now).toFixed(1)} /s`,
        title: say.rate[1],
      },
      {
        label: say.latency[0],
        value: latency === null ? '–' : `${Math.round(latency)} ms`,
        title: latency === null ? say.latencyUnknown : say.latency[1],
      },
      {
        label: say.decode[0],
        value: `${(this.decode.get() ?? 0).toFixed(1)} ms`,
        title: say.decode[1],
        minor: true,
      },
      {
        label: say.vertices,
        value: grouped(this.vertices),
        title: say.triangles(grouped(this.triangles)),
        minor: true,
      },
      {
        label: say.network[0],
        value: bitrate(this.bytes.perSecond(now) * 8),
        title: say.network[1],
        minor: true,
      },
      {
        label: say.drops[0],
        value: grouped(total),
        more: total === 0 ? '' : ` (${places.join(', ')})`,
        title: say.drops[1],
        kind: total === 0 ? 'plain' : 'warn',
      },
    ];
    if (errors > 0) {
      statistics.push({ label: say.errors, value: String(errors), title: this.lastError, kind: 'bad' });
    }
    return statistics;
  }
}

export function grouped(n: number): string {
  return String(n).replace(/\B(?=(\d{3})+$)/g, '\u202f');
}

function bitrate(bits: number): string {
  return bits >= 1e6 ? `${(bits / 1e6).toFixed(1)} Mbit/s` : `${Math.round(bits / 1e3)} kbit/s`;
}
