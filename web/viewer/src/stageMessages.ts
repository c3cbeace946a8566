// SPDX-License-Identifier: Apache-2.0
// What page and drawing worker say to each other. The arrays of a surface are copies, for the page goes on to measure in its own, and
// come back when the next one is shown; its picture is a second one where the decoder made it.
import type { Drawing, Drawn } from './drawing';
import type { Pixels } from './pixels';

export type StageRequest =
  | { type: 'start'; canvas: OffscreenCanvas; antialias: boolean }
  | { type: 'show'; surface: number; frame: Drawn }
  | { type: 'remove'; surface: number }
  | { type: 'draw'; drawing: Drawing }
  | { type: 'read' | 'png'; drawing: Drawing; id: number };

export type StageReply =
  | { type: 'ready' }
  | { type: 'took'; ms: number | null }
  | { type: 'spares'; buffers: ArrayBuffer[] } // of a surface that is not shown any more
  | { type: 'contextLost'; lost: boolean }
  | { type: 'failed'; why: string }
  | { type: 'answer'; id: number; answer: Pixels | Blob | null };
