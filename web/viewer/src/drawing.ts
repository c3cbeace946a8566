// SPDX-License-Identifier: Apache-2.0
// What is said to whoever draws the picture, a worker or this page: numbers alone, so that either can.
import type { Mode } from './display';
import type { Ranges } from './ground';
import type { DecodedFrame } from './messages';
import type { Range } from './palette';
import type { Pixels } from './pixels';
import type { Pinhole } from './protocol';
import type { Rigid } from './rigid';

/** All that a drawing depends on but the surfaces themselves. */
export interface Drawing {
  width: number; // of the canvas, pixels of the page
  height: number;
  ratio: number; // drawn pixels to one of those
  world: number[]; // the viewer's place, a column-major 4x4 matrix
  projection: number[];
  mode: Mode;
  lens: Pinhole | null; // whose distortion bends what is drawn
  range: Range | null; // of the depth mode's colours
  ground: Ranges | null; // null: not drawn
  poses: (Rigid | null)[]; // by surface, of its camera's frame in the scene; null: not drawn
  dimmed: readonly number[]; // surfaces that are not of now
  background: string | null;
  smooth: boolean; // rims, in modes that show a picture or relief
  timed: boolean; // how long the graphics take is told
}

/** Of a frame what is drawn. */
export type Drawn = Pick<DecodedFrame, 'positions' | 'coordinates' | 'normals' | 'triangles' | 'edges' | 'quality' | 'rims' | 'colours' | 'texture'>;

export interface PainterEvents {
  /** For the next draw(): at first, and when that before was handed to the graphics. */
  ready(): void;
  /** They took this long for one of the drawings; null: it is not known. */
  took(ms: number | null): void;
  contextLost(lost: boolean): void;
  failed(why: string): void;
}

/** Draws, in the order asked for. Surfaces have numbers, the first one 0. */
export interface Painter {
  /** The caller keeps the frame and its picture, which stay as they are until the next show(). */
  show(surface: number, frame: DecodedFrame): void;
  remove(surface: number): void;
  draw(drawing: Drawing): void;
  /** Drawn now: what is seen. */
  read(drawing: Drawing): Promise<Pixels>;
  png(drawing: Drawing): Promise<Blob | null>;
  /** For good. */
  end(): void;
}
