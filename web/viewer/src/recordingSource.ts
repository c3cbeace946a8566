// SPDX-License-Identifier: Apache-2.0
// Plays a recording as a source of frames. Like a live one it sends only what the page has credit for, so a slow page
// skips frames and stays in time.
import { PlayClock, type Loop } from './playback';
import type { Recording } from './recording';
import type { FrameSource, Playback, SourceEvents } from './source';

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

export class RecordingSource implements FrameSource, Playback {
  readonly connected = true;
  readonly retryInS = null;
  readonly playback = this as Playback;
  private readonly clock: PlayClock;
  private credits = 1;
  private wanted: number | null = 0; // to be shown whether it plays or not
  private sent = -1;
  private decoded: Decoded = { key: -1, last: -1 };
  private sending = false;
  private timer = 0;
  private stopped = false;
  changed: () => void = () => undefined;

  constructor(
    readonly recording: Recording,
    private readonly events: SourceEvents,
  ) {
    this.clock = new PlayClock(recording.times);
    // Not before the caller holds the source.
    queueMicrotask(() => {
      if (this.stopped) return;
      events.open();
      if (recording.info !== null) events.message({ type: 'info', ...recording.info });
      this.play();
    });
    void recording.readHeads(() => {
      this.changed();
      return !this.stopped;
    });
  }

  get times(): Float64Array {
    return this.recording.times;
  }
  get startMs(): number {
    return this.recording.startMs;
  }
  get index(): number {
    return Math.max(0, this.sent);
  }
  get position(): number {
    return this.clock.position(performance.now());
  }
  get playing(): boolean {
    return this.clock.playing;
  }
  get speed(): number {
    return this.clock.speed;
  }
  get loop(): Loop | null {
    return this.clock.loop;
  }

  isKey(index: number): boolean | null {
    return this.recording.heads[index]?.isKey ?? null;
  }
  gapBefore(index: number): number {
    return this.recording.gapBefore(index);
  }

  play(): void {
    this.clock.play(performance.now());
    this.pump();
  }

  pause(): void {
    this.clock.pause(performance.now());
    this.pump();
  }

  seek(atMs: number): void {
    const now = performance.now();
    this.clock.seek(atMs, now);
    this.wanted = this.clock.index(now);
    this.pump();
  }

  step(frames: number): void {
    this.pause();
    const from = this.wanted ?? this.index;
    this.seek(this.times[Math.min(this.times.length - 1, Math.max(0, from + frames))]!);
  }

  setSpeed(speed: number): void {
    this.clock.setSpeed(speed, performance.now());
    this.pump();
  }

  setLoop(loop: Loop | null): void {
    this.clock.setLoop(loop, performance.now());
    this.pump();
  }

  credit(n = 1): void {
    this.credits += n;
    this.pump();
  }

  retryNow(): void {}

  stop(): void {
    this.stopped = true;
    window.clearTimeout(this.timer);
  }

  // Sends what is due, or comes back when something is.
  private pump(): void {
    window.clearTimeout(this.timer);
    this.changed();
    if (this.stopped || this.sending || this.credits <= 0) return;
    const now = performance.now();
    const due = this.wanted ?? this.clock.index(now);
    if (due !== this.sent || this.wanted !== null) {
      this.wanted = null;
      --this.credits;
      void this.send(due);
      return;
    }
    const wait = this.clock.untilNext(now);
    if (wait !== null) this.timer = window.setTimeout(() => this.pump(), wait);
  }

  private async send(index: number): Promise<void> {
    this.sending = true;
    this.sent = index;
    try {
      const key = await this.recording.keyBefore(index);
      if (key === null) throw new Error('this frame builds on one that the recording does not have');
      for (const before of framesBefore(index, key, this.decoded, await this.recording.buildsOnFrameBefore(index))) {
        await this.hand(before, true);
        if (this.stopped) return;
        this.decoded = { key, last: before };
      }
      await this.hand(index, false);
      this.decoded = { key, last: index };
    } catch (error) {
      ++this.credits;
      if (!this.stopped) this.events.nonsense(error instanceof Error ? error.message : String(error));
    }
    this.sending = false;
    this.pump();
  }

  private async hand(index: number, forLater: boolean): Promise<void> {
    const { head, message } = await this.recording.read(index);
    if (this.stopped) return;
    const { at, length, sequence, captureMs, publishMs } = head;
    const prefix = { bytes: at, sequence, captureMs, publishMs, sentMs: publishMs, drops: 0 };
    // DDS fills a message up to whole words; a frame has nothing behind its end.
    this.events.frame(prefix, message.slice(0, at + length).buffer, forLater);
  }
}
