// SPDX-License-Identifier: Apache-2.0
// What a decoded frame holds, for those who hand it on or have no more use for it.
import type { DecodedFrame } from './messages';

type Arrays = Pick<DecodedFrame, 'positions' | 'coordinates' | 'normals' | 'triangles' | 'edges' | 'quality' | 'rims' | 'colours'>;

/** The memory of its arrays, each once. */
export function buffersOf({ positions, coordinates, normals, triangles, edges, quality, rims, colours }: Arrays): ArrayBuffer[] {
  const arrays = [positions, coordinates, normals, triangles, edges, rims, colours, quality?.sigmas, quality?.interpolated];
  return [...new Set(arrays.flatMap((array) => (array == null || array.byteLength === 0 ? [] : [array.buffer])))];
}

export function closePictures(frame: DecodedFrame): void {
  frame.texture?.close();
  frame.handOn?.close();
}
