// SPDX-License-Identifier: Apache-2.0
// Plays stored frames. Like a live stream it sends only what the page has credit for, so a slow page skips frames and
// stays in time.
import type { FrameStore } from './frameStore';
import { Final, Unavailable } from './missing';
import { PlayClock, type Loop } from './playback';
import type { FramePrefix } from './protocol';
import type { Missing, Playback, SourceEvents } from './source';

const kLateMs = 1500; // a frame that takes longer to come is waited for
const kAgainMs = 1000; // before what did not come is asked for again
const kLongestWaitMs = 2 ** 30; // browsers take what is twice as long for none

/** What the decoder holds: the key frame, and the last frame that was decoded after it. */
export interface Decoded {
  key: number;
  last: number;
}

/**
 * What has to be decoded before a frame whose key frame is `key`. Grids build on the key frame alone, video (`onBefore`)
 * on the frame before and so on all since the key frame.
 */
export function framesBefore(index: number, key: number, decoded: Decoded, onBefore: boolean): number[] {
  if (key === index) return [];
  const known = decoded.key === key;
  if (!onBefore) return known ? [] : [key];
  const first = known && decoded.last < index ? decoded.last + 1 : key;
  return Array.from({ length: index - first }, (_, i) => first + i);
}

export interface PlayerEvents extends Pick<SourceEvents, 'frame' | 'nonsense' | 'timers'> {
  /** This frame was handed over. */
  sent?(index: number): void;
  /** It played to the end of what there is. */
  ended?(): void;
}

export class StorePlayer implements Playback {
  readonly following: boolean | null = null;
  readonly newestMs: number | null = null;
  private readonly clock: PlayClock;
  private wanted: number | null; // to be shown whether it plays or not
  private last = -1; // sent
  private runs = 0; // begun
  private run_ = 0; // of `last`
  private decoded: Decoded = { key: -1, last: -1 };
  private sending = false;
  private sends = 0; // begun
  private overdue = false; // what is being sent does not come
  private running = false;
  private late = false; // the clock stands until the frame that is being read has come
  private failure: Missing | null = null; // of the frame that was read last
  private timer = 0;
  protected stopped = false;
  changed: () => void = () => undefined;

  /** Begins with the first frame; `credits`: how many frames the page can take now. */
  constructor(
    public store: FrameStore,
    private readonly handed: PlayerEvents,
    private credits = 1,
  ) {
    this.clock = new PlayClock(this);
    this.wanted = store.first;
  }

  get times(): Float64Array {
    return this.store.times;
  }
  get startMs(): number {
    return this.store.startMs;
  }
  get first(): number {
    return this.store.first;
  }
  get index(): number {
    return Math.max(this.first, this.last);
  }
  get run(): number {
    return this.run_;
  }
  get position(): number {
    return this.clock.position(performance.now());
  }
  /** Until its last frame was taken by the page, which may be later than its clock's end. */
  get playing(): boolean {
    return this.running;
  }
  /** Why the frame that is to be shown next does not come; null: it does. */
  get missing(): Missing | null {
    return this.failure ?? (this.late ? { why: '', passing: true } : null);
  }
  get speed(): number {
    return this.clock.speed;
  }
  get loop(): Loop | null {
    return this.clock.loop;
  }

  isKey(index: number): boolean | null {
    return this.store.isKey(index);
  }
  gapBefore(index: number): number {
    return this.store.gapBefore(index);
  }

  play(): void {
    const now = performance.now();
    this.running = true;
    this.clock.play(now);
    if (this.late) this.clock.pause(now);
    this.pump();
  }

  pause(): void {
    this.running = false;
    this.clock.pause(performance.now());
    this.pump();
  }

  seek(atMs: number): void {
    const now = performance.now();
    if (this.late ? this.isOver(now) : !this.clock.playing) this.running = false; // also where it has just come to the end
    this.clock.seek(atMs, now);
    this.wanted = this.due(now);
    ++this.runs;
    if (this.overdue) this.giveUp();
    this.pump();
  }

  step(frames: number): void {
    this.pause();
    const { times, first } = this.store;
    const from = (this.wanted ?? this.index) - first;
    this.seek(times[Math.min(times.length - 1, Math.max(0, from + frames))]!);
  }

  setSpeed(speed: number): void {
    this.clock.setSpeed(speed, performance.now());
    this.pump();
  }

  setLoop(loop: Loop | null): void {
    this.clock.setLoop(loop, performance.now());
    this.pump();
  }

  follow(): void {}

  credit(n = 1): void {
    this.credits += n;
    this.pump();
  }

  stop(): void {
    this.stopped = true;
    this.timers.clearTimeout(this.timer);
  }

  private get timers(): Window {
    return this.handed.timers ?? window;
  }

  private due(now: number): number {
    return this.first + this.clock.index(now);
  }

  // Sends what is due, or comes back when something is.
  private pump(): void {
    this.timers.clearTimeout(this.timer);
    this.changed();
    if (this.stopped || this.sending || this.credits <= 0) return;
    const now = performance.now();
    const due = Math.max(this.first, this.wanted ?? this.due(now));
    if (due !== this.last || this.wanted !== null) {
      this.wanted = null;
      this.run_ = this.runs;
      --this.credits;
      void this.send(due);
      return;
    }
    const wait = this.clock.untilNext(now);
    if (wait !== null) {
      this.timer = this.timers.setTimeout(() => this.pump(), Math.min(wait, kLongestWaitMs));
    } else if (this.running) {
      this.running = false;
      this.ended();
    }
  }

  protected ended(): void {
    this.handed.ended?.();
  }

  // What has not come for a while, since something else is wanted.
  private giveUp(): void {
    ++this.sends;
    ++this.credits;
    this.sending = this.overdue = false;
    this.store.giveUp?.();
  }

  private async send(index: number): Promise<void> {
    const id = ++this.sends;
    this.sending = true;
    this.last = index;
    const late = this.timers.setTimeout(() => this.beLate(index), kLateMs);
    try {
      const key = await this.store.keyBefore(index);
      if (key === null) throw new Error('this frame builds on one that is not there');
      for (const before of framesBefore(index, key, this.decoded, await this.store.buildsOnFrameBefore(index))) {
        await this.hand(before, true, id);
        if (this.isLeft(id)) return;
        this.decoded = { key, last: before };
      }
      await this.hand(index, false, id);
      if (this.isLeft(id)) return;
      this.decoded = { key, last: index };
      this.arrived();
    } catch (error) {
      if (this.isLeft(id)) return;
      this.fail(index, error);
      if (error instanceof Unavailable) {
        this.beLate(index);
        await new Promise((resolve) => this.timers.setTimeout(resolve, kAgainMs));
        if (this.isLeft(id)) return;
      }
      ++this.credits;
    } finally {
      this.timers.clearTimeout(late);
    }
    this.sending = this.overdue = false;
    this.handed.sent?.(index);
    this.pump();
  }

  private isLeft(id: number): boolean {
    return this.stopped || id !== this.sends;
  }

  private beLate(index: number): void {
    this.overdue = true;
    this.wait(index);
    if (this.wanted === null || this.wanted === index) return;
    this.giveUp();
    this.pump();
  }

  // As a <video> does, the clock goes on from the frame that did not come.
  private wait(index: number): void {
    if (this.stopped || this.late) return;
    const now = performance.now();
    this.late = true;
    this.clock.pause(now);
    if (this.running && this.wanted === null) this.clock.seek(this.times[index - this.first]!, now);
    this.changed();
  }

  private arrived(): void {
    const { late } = this;
    this.late = false;
    this.failure = null;
    const now = performance.now();
    if (late && this.running && !this.isOver(now)) this.clock.play(now);
  }

  private isOver(now: number): boolean {
    return this.clock.position(now) >= (this.loop?.to ?? this.clock.end);
  }

  private fail(index: number, error: unknown): void {
    const why = error instanceof Error ? error.message : String(error);
    if (error instanceof Unavailable) {
      this.failure = { why, passing: true };
      this.wait(index);
      this.wanted ??= index; // asked for again
      return;
    }
    this.arrived();
    if (error instanceof Final) {
      this.failure = { why, passing: false };
      this.running = false;
      this.clock.pause(performance.now());
    }
    this.handed.nonsense(why);
  }

  private async hand(index: number, forLater: boolean, id: number): Promise<void> {
    const { prefix, message } = await this.store.read(index);
    if (this.isLeft(id)) return;
    this.handing(prefix);
    this.handed.frame(prefix, message, forLater);
  }

  /** This frame is handed over next. */
  protected handing(_prefix: FramePrefix): void {}
}
