// SPDX-License-Identifier: Apache-2.0
// Where frames come from: a live stream, or a recording. One kind of events, whichever it is.
import type { Loop } from './playback';
import type { FramePrefix, ServerMessage } from './protocol';

export interface SourceEvents {
  open(): void;
  lost(): void;
  message(message: ServerMessage): void;
  /** `forLater`: only decoded, since the frames behind it build on it; its credit is not asked back. */
  frame(prefix: FramePrefix, message: ArrayBuffer, forLater: boolean): void;
  clock(t0: number, serverMs: number, t1: number): void;
  /** Something makes no sense; if it was a frame, its credit is given back. */
  nonsense(message: string): void;
}

export interface FrameSource {
  readonly connected: boolean;
  /** Whole seconds until the next attempt; null while connected or connecting for the first time. */
  readonly retryInS: number | null;
  /** The time line, where there is one. */
  readonly playback: Playback | null;
  /** This many frames more may come. */
  credit(n?: number): void;
  retryNow(): void;
  stop(): void;
}

/** What a time line drives: a source that can show more than what comes next. Times in ms from the first frame. */
export interface Playback {
  readonly times: Float64Array; // of the frames
  readonly startMs: number; // UTC of the first
  readonly index: number; // the frame sent last
  readonly position: number;
  readonly playing: boolean;
  readonly speed: number;
  readonly loop: Loop | null;
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
  /** Called whenever one of these has changed, except `position`. */
  changed: () => void;
}
