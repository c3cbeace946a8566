// SPDX-License-Identifier: Apache-2.0
// Frames that can be read in any order: those of a recording, or the last ones of a live stream.
import type { FramePrefix, StreamInfo } from './protocol';

export interface StoredFrame {
  prefix: FramePrefix;
  message: ArrayBuffer; // the reader's own; the frame begins behind the prefix
}

/** A message as recordings hold it. */
export interface Sample {
  data: Uint8Array; // CDR
  sequence: number; // 32 bits of it
  logNs: bigint; // UTC
  publishNs: bigint;
}

export const publishMsOf = ({ publishNs }: Sample): number => Number(publishNs / 1000n) / 1000;

const kPlausibleAgeMs = 60_000; // a frame captured longer before it was published is of a take, and has the take's time

/** Of a live frame: when it was captured. */
export const utcMsOf = ({ captureMs, publishMs }: { readonly captureMs: number; readonly publishMs: number }): number =>
  Math.abs(publishMs - captureMs) < kPlausibleAgeMs ? captureMs : publishMs;

/** A frame keeps its index: of a live stream the first ones go and others come. */
export interface FrameStore {
  readonly stream: string;
  readonly times: Float64Array; // rising, ms from `startMs`; of the frames there are now
  readonly startMs: number; // UTC
  readonly first: number; // index of the frame at times[0]
  /** Whether a frame decodes alone; null: not known yet. */
  isKey(index: number): boolean | null;
  /** Frames lost before this one. */
  gapBefore(index: number): number;
  /** The last frame up to this one that decodes alone; null where there is none. */
  keyBefore(index: number): Promise<number | null>;
  /** Whether it holds video that builds on the frame before it. */
  buildsOnFrameBefore(index: number): Promise<boolean>;
  read(index: number): Promise<StoredFrame>;
  /** Nobody waits any more for what was asked for and has not come. */
  giveUp?(): void;
  /** The same as a recording would hold it. */
  sample(index: number): Promise<Sample>;
  /** What describes the stream's frames that were published then (ms UTC), likewise; null: the store does not have it. */
  describing(publishMs: number): Uint8Array | null;
  /** The same of a frame, where it came with it and not as a recording has it. */
  infoOf?(index: number): StreamInfo | null;
  /** These frames, which stay there while others come. */
  held(): FrameStore;
}
