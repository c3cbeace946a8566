// SPDX-License-Identifier: Apache-2.0
// The last frames of a live stream as they came, so that a person can go back to them. Bounded in time and in bytes.
import { kTextureH264, parseFrame } from './frame';
import { utcMsOf, type FrameStore, type Sample, type StoredFrame } from './frameStore';
import type { FramePrefix, StreamInfo } from './protocol';
import { videoTextureIsKey } from './videoTexture';

export interface HistoryLimits {
  ms: number;
  bytes: number;
}
export const kHistoryLimits: Readonly<HistoryLimits> = { ms: 60_000, bytes: 256e6 };

const kNewClockMs = 1000; // a step back of more than this is another clock

interface Kept {
  prefix: FramePrefix;
  message: ArrayBuffer;
  atMs: number; // from startMs
  isKey: boolean;
  onBefore: boolean; // builds on the frame before it, not only on the key frame
  info: StreamInfo | null;
}

export class History implements FrameStore {
  startMs = 0;
  first = 0;
  bytes = 0;
  /** What describes the frames that come from now on. */
  info: StreamInfo | null = null;
  private kept: Kept[] = [];
  private times_: Float64Array | null = null; // made when asked for
  /** Told before a frame goes, and all before it. */
  going: (index: number) => void = () => undefined;

  constructor(
    readonly limits: Readonly<HistoryLimits> = kHistoryLimits,
    readonly stream = '',
  ) {}

  get times(): Float64Array {
    return (this.times_ ??= Float64Array.from(this.kept, (k) => k.atMs));
  }
  /** Index behind the newest. */
  get end(): number {
    return this.first + this.kept.length;
  }
  describing(): null {
    return null;
  }
  infoOf(index: number): StreamInfo | null {
    return this.at(index)?.info ?? null;
  }

  /** From the oldest to the newest. */
  get spanMs(): number {
    const [first, last] = [this.kept[0], this.kept[this.kept.length - 1]];
    return first === undefined ? 0 : last!.atMs - first.atMs;
  }

  /** All there is, oldest first; to be read only. */
  get messages(): ArrayBuffer[] {
    return this.kept.map((k) => k.message);
  }

  /** Copies it, which is to be read only; what is no frame, or was kept before, is left out: null. */
  add(prefix: FramePrefix, message: ArrayBuffer): ArrayBuffer | null {
    const last = this.kept[this.kept.length - 1];
    // After a connection was lost the last key frame comes again.
    if (last !== undefined && prefix.sequence <= last.prefix.sequence && prefix.captureMs <= last.prefix.captureMs) return null;
    const dependence = dependenceOf(new Uint8Array(message, prefix.bytes));
    if (dependence === null) return null;
    const utcMs = utcMsOf(prefix);
    if (last !== undefined && utcMs - this.startMs < last.atMs - kNewClockMs) this.clear();
    if (this.kept.length === 0) {
      if (!dependence.isKey) return null; // nothing could ever show it
      this.startMs = utcMs;
    }
    const atMs = this.kept.length === 0 ? 0 : Math.max(utcMs - this.startMs, last!.atMs + 1e-3);
    const copy = message.slice(0);
    this.kept.push({ prefix, message: copy, atMs, info: this.info, ...dependence });
    this.bytes += message.byteLength;
    this.times_ = null;
    this.trim();
    return copy;
  }

  isKey(index: number): boolean | null {
    return this.at(index)?.isKey ?? null;
  }

  gapBefore(index: number): number {
    const [before, here] = [this.at(index - 1), this.at(index)];
    if (before === undefined || here === undefined) return 0;
    return Math.max(0, here.prefix.sequence - before.prefix.sequence - 1);
  }

  async keyBefore(index: number): Promise<number | null> {
    for (let i = index; i >= this.first; --i) {
      if (this.at(i)?.isKey === true) return i;
    }
    return null;
  }

  async buildsOnFrameBefore(index: number): Promise<boolean> {
    return this.at(index)?.onBefore === true;
  }

  async read(index: number): Promise<StoredFrame> {
    const kept = this.at(index);
    if (kept === undefined) throw new Error('this frame is no longer kept');
    return { prefix: kept.prefix, message: kept.message.slice(0) };
  }

  async sample(index: number): Promise<Sample> {
    const kept = this.at(index);
    if (kept === undefined) throw new Error('this frame is no longer kept');
    const { sampleOf } = await import('./sample');
    return sampleOf(this.stream, kept.message);
  }

  held(): FrameStore {
    const held = new History({ ms: Infinity, bytes: Infinity }, this.stream);
    held.startMs = this.startMs;
    held.first = this.first;
    held.kept = [...this.kept];
    return held;
  }

  private at(index: number): Kept | undefined {
    return this.kept[index - this.first];
  }

  private clear(): void {
    this.going(this.end - 1);
    this.first = this.end;
    this.kept = [];
    this.bytes = 0;
    this.times_ = null;
  }

  // What is left begins with a key frame: the others before it could not be shown.
  private trim(): void {
    const over = (): boolean => this.bytes > this.limits.bytes || this.spanMs > this.limits.ms;
    let gone = 0;
    while (this.kept.length > 1 && over()) gone = this.drop();
    while (gone > 0 && this.kept[0]?.isKey === false) this.drop();
  }

  private drop(): number {
    this.going(this.first);
    this.bytes -= this.kept.shift()!.message.byteLength;
    this.times_ = null;
    return ++this.first;
  }
}

/** Null where the bytes are no frame. */
function dependenceOf(bytes: Uint8Array): { isKey: boolean; onBefore: boolean } | null {
  try {
    const frame = parseFrame(bytes);
    return { isKey: frame.isKey, onBefore: frame.textureCodec === kTextureH264 && !videoTextureIsKey(frame.texture) };
  } catch {
    return null; // the decoder tells what is wrong with it
  }
}
