// SPDX-License-Identifier: Apache-2.0
// What was just drawn, in a few numbers.

/** RGBA, from the lowest row. */
export interface Pixels {
  width: number;
  height: number;
  rgba: Uint8Array<ArrayBuffer>;
}

export interface PixelReport {
  width: number;
  height: number;
  covered: number; // share of the pixels that the surface covers
  mean: number; // brightness of those, 0..255
  deviation: number;
  hash: number;
}

export function pixelsOf(gl: WebGL2RenderingContext): Pixels {
  const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
  const rgba = new Uint8Array(width * height * 4);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, rgba);
  return { width, height, rgba };
}

export function reportOf({ width, height, rgba }: Pixels): PixelReport {
  let [count, sum, squares, hash] = [0, 0, 0, 2166136261];
  for (let i = 0; i < rgba.length; i += 4) {
    if (rgba[i + 3]! < 128) continue;
    const value = (rgba[i]! + 2 * rgba[i + 1]! + rgba[i + 2]!) / 4;
    ++count;
    sum += value;
    squares += value * value;
    hash = Math.imul(hash ^ (i + value), 16777619) >>> 0;
  }
  const mean = count > 0 ? sum / count : 0;
  const deviation = count > 0 ? Math.sqrt(Math.max(0, squares / count - mean * mean)) : 0;
  return { width, height, covered: count / (width * height), mean, deviation, hash };
}
