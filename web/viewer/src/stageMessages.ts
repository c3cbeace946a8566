// SPDX-License-Identifier: Apache-2.0
// What page and drawing worker say to each other. Surfaces are copied: the page goes on to measure in them.
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
  | { type: 'contextLost'; lost: boolean }
  | { type: 'failed'; why: string }
  | { type: 'answer'; id: number; answer: Pixels | Blob | null };
