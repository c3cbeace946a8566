// SPDX-License-Identifier: Apache-2.0
// What the page and the worker that measures shapes say to each other. Arrays and pictures are transferred, never copied.
import type { Lens } from './lens';
import type { Surface } from './pick';
import type { Region } from './region';
import type { Shape, ShapeKind } from './shape';
import type { ShapeReport } from './shapeMeter';

/** By which a meter is made. */
export interface Metered {
  readonly lens: Lens;
  readonly region: Region;
  readonly kind: ShapeKind;
}

export interface ShapeRequest {
  meter: Metered | null; // null: as before
  joins: 'none' | 'frames' | 'butTheLast'; // of those before
  surface: Surface;
}

export type ShapeReply =
  | { type: 'failed'; message: string }
  | {
      type: 'measured';
      report: ShapeReport | null; // null: no frame shows the shape
      shape: Shape | null; // of the last frame
      picture: ImageBitmap | null; // of the report
      full_m: number; // the picture is of full colour there
      took_ms: number;
    };
