// SPDX-License-Identifier: Apache-2.0
// A surface as a binary PLY file, as `relievo export` writes it. Pure.
import { toSrgb } from './palette';
import type { Surface } from './pick';

export interface Pixels {
  width: number;
  height: number;
  rgba: Uint8ClampedArray;
}

/** Colours are the picture's nearest pixels; without, those of the vertices, or grey. */
export function writePly(surface: Surface, picture: Pixels | null): Uint8Array<ArrayBuffer> {
  const { positions, triangles, quality } = surface;
  const vertices = positions.length / 3;
  const faces = triangles.length / 3;
  const header = [
    'ply',
    'format binary_little_endian 1.0',
    'comment relievo: metres, camera frame: x right, y down, z forward',
    `element vertex ${vertices}`,
    ...['x', 'y', 'z'].map((name) => `property float ${name}`),
    ...['red', 'green', 'blue'].map((name) => `property uchar ${name}`),
    ...(quality === null ? [] : ['property float sigma', 'property uchar interpolated']),
    `element face ${faces}`,
    'property list uchar int vertex_indices',
    'end_header\n',
  ].join('\n');
  const head = new TextEncoder().encode(header);
  const stride = 15 + (quality === null ? 0 : 5);
  const out = new Uint8Array(head.length + vertices * stride + faces * 13);
  out.set(head);
  const view = new DataView(out.buffer);
  let at = head.length;
  for (let v = 0; v < vertices; ++v, at += stride) {
    for (let i = 0; i < 3; ++i) view.setFloat32(at + 4 * i, positions[3 * v + i]!, true);
    out.set(colourAt(picture, surface, v), at + 12);
    if (quality === null) continue;
    view.setFloat32(at + 15, quality.sigmas[v]!, true);
    out[at + 19] = quality.interpolated[v]!;
  }
  for (let t = 0; t < triangles.length; t += 3, at += 13) {
    out[at] = 3;
    for (let i = 0; i < 3; ++i) view.setInt32(at + 1 + 4 * i, triangles[t + i]!, true);
  }
  return out;
}

function colourAt(picture: Pixels | null, { coordinates, colours }: Surface, v: number): ArrayLike<number> {
  if (picture === null || coordinates === null) return colours == null ? [180, 180, 180] : Array.from(colours.subarray(3 * v, 3 * v + 3), toSrgb);
  const place = (share: number, size: number): number => Math.min(size - 1, Math.max(0, Math.floor(share * size)));
  const column = place(coordinates[2 * v]!, picture.width);
  const row = place(coordinates[2 * v + 1]!, picture.height);
  const pixel = (row * picture.width + column) * 4;
  return picture.rgba.subarray(pixel, pixel + 3);
}
