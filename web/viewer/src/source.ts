// SPDX-License-Identifier: Apache-2.0
// Where frames come from: a live stream, or a recording. One kind of events, whichever it is.
import type { FrameStore } from './frameStore';
import type { Loop } from './playback';
import type { FramePrefix, ServerMessage, Written } from './protocol';
import type { Refusal } from './state';

export interface SourceEvents {
  open(): void;
  lost(): void;
  message(message: ServerMessage): void;
  /** `forLater`: only decoded, since the frames behind it build on it; its credit is not asked back. */
  frame(prefix: FramePrefix, message: ArrayBuffer, forLater: boolean): void;
  /** So much came and is not shown now, but kept. */
  kept?(bytes: number): void;
  clock(t0: number, serverMs: number, t1: number): void;
  /** Something makes no sense; if it was a frame, its credit is given back. */
  nonsense(message: string): void;
  /** The server lets nobody in without a token, which the page does not have (any more). */
  signIn?(): void;
  /** Of the window that shows it: those of one in the background come late. */
  readonly timers?: Window | undefined;
}

/** Why a recording's next frame does not come; '': it has not for a while. `passing`: it is asked for again. */
export interface Missing {
  readonly why: string;
  readonly passing: boolean;
}

export interface FrameSource {
  readonly connected: boolean;
  /** Whole seconds until the next attempt; null while connected or connecting for the first time. */
  readonly retryInS: number | null;
  /** Why the server lets nobody in, where it says so. */
  readonly refusal?: Refusal | null;
  readonly playback: Playback;
  readonly missing?: Missing | null;
  /** Whether what comes now is of now: what is missing was lost, its age is a latency. */
  readonly live: boolean;
  /** What is kept of a live stream; null: a recording. */
  readonly kept: Kept | null;
  /** This many frames more may come: so many were shown, or not even that. */
  credit(n?: number, shown?: boolean): void;
  retryNow(): void;
  /** Nobody sees the picture: what is not asked for yet need not come, until it is to again. A recording comes by credit alone. */
  rest?(resting: boolean): void;
  /**
   * Of a recording of the server: what the server says of it now, so that what it wrote since is shown, too; undefined:
   * it writes another, or none.
   */
  told?(recorder: Written | undefined): Promise<void>;
  stop(): void;
}

export interface Kept {
  readonly spanMs: number;
  readonly bytes: number;
  readonly limits: { readonly ms: number; readonly bytes: number };
}

/** A time to begin at, and whether it plays from there. */
export interface Moment {
  readonly atMs: number; // since the recording's start, or UTC where `utc`
  readonly utc: boolean;
  readonly playing: boolean;
}

/** What a time line drives: a source that can show more than what comes next. Times in ms from `startMs`. */
export interface Playback {
  /** The frames themselves, to be read in any order. */
  readonly store: FrameStore;
  readonly times: Float64Array; // of the frames there are; of a live stream it changes
  readonly startMs: number; // UTC
  readonly first: number; // index of the frame at times[0]
  readonly index: number; // the frame sent last
  readonly run: number; // it is of: those of one came one after the other, each seek or step begins another
  readonly position: number;
  readonly playing: boolean;
  readonly speed: number;
  readonly loop: Loop | null;
  /** Of a live stream: whether what comes next is shown; null: a recording. */
  readonly following: boolean | null;
  /** UTC of the last frame that came, which `times` may end before; null: a recording. */
  readonly newestMs: number | null;
  /** Whether a frame decodes alone; null: not known yet. */
  isKey(index: number): boolean | null;
  /** Frames lost before this one. */
  gapBefore(index: number): number;
  play(): void;
  pause(): void;
  seek(atMs: number): void;
  step(frames: number): void;
  setSpeed(speed: number): void;
  setLoop(loop: Loop | null): void;
  /** Back to what comes next; a recording has no such. */
  follow(): void;
  /** Called whenever one of these has changed, except `position`. */
  changed: () => void;
}
