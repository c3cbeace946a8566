// SPDX-License-Identifier: Apache-2.0
// Which frames a range of the time line has. Pure.
import type { FrameStore } from './frameStore';
import { frameAt } from './playback';

export const kRangeFormats = ['mcap', 'ply', 'glb'] as const;
export type RangeFormat = (typeof kRangeFormats)[number];

/** The frames that are seen from one time to another: the indices of the first and the last. */
export function framesBetween({ times, first }: Pick<FrameStore, 'times' | 'first'>, from: number, to: number): [number, number] {
  return [first + frameAt(times, from), first + frameAt(times, to)];
}
