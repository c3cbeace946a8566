// SPDX-License-Identifier: Apache-2.0
// What page and worker say to each other. Arrays and pictures are transferred, never copied.
import type { Wants } from './display';
import type { VertexQuality } from './quality';
import type { Extent } from './surface';

export interface DecodeRequest {
  type: 'decode';
  id: number;
  bytes: ArrayBuffer;
  offset: number; // of the frame in `bytes`
  want: Wants;
  spares: ArrayBuffer[]; // of frames that are not shown any more: to be filled again
}

/** What a person is to know of frames; in words: strings.ts. */
export type Notice = 'videoInsecure' | 'videoUnknown';

export interface DecodedFrame {
  type: 'frame';
  id: number;
  number: number; // of the camera frame
  positions: Float32Array<ArrayBuffer>;
  coordinates: Float32Array<ArrayBuffer> | null;
  normals: Float32Array<ArrayBuffer> | null;
  triangles: Uint32Array<ArrayBuffer>;
  edges: Uint32Array<ArrayBuffer> | null;
  rims?: Float32Array<ArrayBuffer> | null; // how far inside each vertex is (rims.ts)
  quality: VertexQuality | null; // null: not wanted or not sent
  codedQuality?: Uint8Array<ArrayBuffer> | null; // what was sent and not wanted then, for decodeVertexQuality()
  colours?: Float32Array<ArrayBuffer> | null; // linear RGB a vertex, of files without a picture
  texture: ImageBitmap | null;
  handOn?: ImageBitmap | null; // the same picture once more, for what draws: a copy would take longer than all else there
  notice: Notice | null; // while frames are like this one
  extent: Extent | null;
  decodeMs: number;
  kept?: boolean; // somebody holds on to its arrays
}

export type DecodeReply =
  | { type: 'ready' }
  | { type: 'loading' } // a part of the decoder; 'ready' follows
  | { type: 'unusable'; message: string } // the decoder cannot be loaded at all
  | { type: 'failed'; id: number; message: string }
  | DecodedFrame;
