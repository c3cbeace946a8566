// SPDX-License-Identifier: Apache-2.0
// The time of what is played: playing, speed, a range to repeat. Pure; the clock is given, in milliseconds.

export const kSpeeds = [0.1, 0.25, 0.5, 1, 2, 4, 8] as const;

export interface Loop {
  from: number; // ms of the recording
  to: number;
}

export class PlayClock {
  playing = false;
  private speed_ = 1;
  private loop_: Loop | null = null;
  private at = 0; // ms of the recording, at `since`
  private since = 0;

  /** Of frames at rising times, at least one; those of a live stream change. */
  constructor(private readonly of: { readonly times: Float64Array }) {}

  get begin(): number {
    return this.of.times[0]!;
  }
  get end(): number {
    const { times } = this.of;
    return times[times.length - 1]!;
  }
  get speed(): number {
    return this.speed_;
  }
  get loop(): Loop | null {
    return this.loop_;
  }

  setSpeed(speed: number, now: number): void {
    this.hold(now);
    this.speed_ = Math.min(8, Math.max(0.1, speed));
  }

  /** At the end it begins again. */
  play(now: number): void {
    this.hold(now);
    const end = this.loop_?.to ?? this.end;
    if (this.at >= end) this.at = this.loop_?.from ?? this.begin;
    this.playing = true;
  }

  pause(now: number): void {
    this.hold(now);
    this.playing = false;
  }

  seek(at: number, now: number): void {
    this.at = Math.min(this.end, Math.max(this.begin, at));
    this.since = now;
  }

  /** What is repeated; null: all, once. A range without length is none. */
  setLoop(loop: Loop | null, now: number): void {
    this.hold(now);
    this.loop_ = loop !== null && loop.to > loop.from ? loop : null;
  }

  /** Ms of the recording. Stops at the end, unless a range is repeated. */
  position(now: number): number {
    const from = Math.max(this.at, this.begin); // what was there may be gone
    if (!this.playing) return from;
    const at = from + (now - this.since) * this.speed_;
    const loop = this.loop_;
    if (loop !== null && at > loop.to) {
      this.at = loop.from + ((at - loop.from) % (loop.to - loop.from));
      this.since = now;
      return this.at;
    }
    if (loop === null && at >= this.end) {
      this.at = this.end;
      this.playing = false;
      return this.at;
    }
    return at;
  }

  /** The last frame that is due: its place among the times. */
  index(now: number): number {
    return frameAt(this.of.times, this.position(now));
  }

  /** Until the next frame is due; null where none comes. */
  untilNext(now: number): number | null {
    const at = this.position(now);
    if (!this.playing) return null;
    const next = this.of.times[frameAt(this.of.times, at) + 1] ?? this.end;
    const end = this.loop_ === null ? next : Math.min(next, this.loop_.to + 1e-3);
    return Math.max(0, (end - at) / this.speed_);
  }

  private hold(now: number): void {
    this.at = this.position(now);
    this.since = now;
  }
}

/** The last of rising `times` not behind `at`; 0 before the first. */
export function frameAt(times: Float64Array, at: number): number {
  let [low, high] = [0, times.length];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle]! <= at + 1e-6) low = middle;
    else high = middle;
  }
  return low;
}

/** "1:02:03.045" */
export function clockText(ms: number): string {
  const total = Math.max(0, Math.round(ms));
  const two = (n: number): string => String(n).padStart(2, '0');
  const [hours, minutes] = [Math.floor(total / 3_600_000), Math.floor(total / 60_000) % 60];
  const seconds = `${two(Math.floor(total / 1000) % 60)}.${String(total % 1000).padStart(3, '0')}`;
  return hours > 0 ? `${hours}:${two(minutes)}:${seconds}` : `${minutes}:${seconds}`;
}
