// SPDX-License-Identifier: Apache-2.0
// Which frames a range of the time line has, and what their files are called. Pure.
import type { FrameStore } from './frameStore';
import { frameAt } from './playback';

export const kRangeFormats = ['mcap', 'ply', 'glb'] as const;
export type RangeFormat = (typeof kRangeFormats)[number];

/** The frames that are seen from one time to another: the indices of the first and the last. */
export function framesBetween({ times, first }: Pick<FrameStore, 'times' | 'first'>, from: number, to: number): [number, number] {
  return [first + frameAt(times, from), first + frameAt(times, to)];
}

/** A name of its own for each frame's file, as `relievo export` has it, whose numbers begin anew with a server that does. */
export class FrameNames {
  private readonly given = new Map<string, number>(); // how often
  private before: number | null = null; // the camera's frame whose surface between came last

  /** `next`: the number of the frame behind it; null: there is none. */
  name(number: number, next: number | null): string {
    const isBetween = next === number && this.before !== number; // the first of two surfaces of a camera's frame
    this.before = isBetween ? number : null;
    const name = `${String(number).padStart(6, '0')}${isBetween ? '_between' : ''}`;
    const times = (this.given.get(name) ?? 0) + 1;
    this.given.set(name, times);
    return times === 1 ? name : `${name}-${times}`;
  }
}
