// SPDX-License-Identifier: Apache-2.0
// A decoded frame as the bytes of a file. Loaded when it is needed.
import { writeGlb } from './exportGlb';
import { writePly, type Pixels } from './exportPly';
import type { DecodedFrame } from './messages';

const kJpegQuality = 0.92;

export function plyOf(frame: DecodedFrame): Uint8Array<ArrayBuffer> {
  return writePly(frame, frame.texture === null ? null : pixelsOf(frame.texture));
}

/** `jpeg`: its texture as it was sent; null: it is coded here. */
export async function glbOf(frame: DecodedFrame, jpeg: Uint8Array | null = null): Promise<Uint8Array<ArrayBuffer>> {
  if (frame.texture === null || jpeg !== null) return writeGlb(frame, jpeg);
  const coded = await drawn(frame.texture).convertToBlob({ type: 'image/jpeg', quality: kJpegQuality });
  return writeGlb(frame, new Uint8Array(await coded.arrayBuffer()));
}

function drawn(bitmap: ImageBitmap): OffscreenCanvas {
  const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
  canvas.getContext('2d')!.drawImage(bitmap, 0, 0);
  return canvas;
}

function pixelsOf(bitmap: ImageBitmap): Pixels {
  const { width, height } = bitmap;
  const { data } = drawn(bitmap).getContext('2d')!.getImageData(0, 0, width, height);
  return { width, height, rgba: data };
}
