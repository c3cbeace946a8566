// SPDX-License-Identifier: Apache-2.0
// How many of the screen's pixels are drawn. Where the graphics are weak, or there are none and the processor
// draws, a coarser picture at the stream's rate serves better than a fine one that stutters.

import { hasOffscreen } from './workers';

const kSlow_ms = 22; // a frame of 30 a second, less what the rest of the page needs
const kFast_ms = 9; // one step up costs 1.6 times as much and stays below kSlow_ms
const kStep = 0.8;
const kLeast = 0.5;
const kIgnored = 4; // drawings after a change, which makes new buffers, and at the start, which compiles shaders
const kEnough = 6; // more of them to judge by
const kLong_ms = 3000; // of drawings, that are enough, too, however few
const kWeight = 0.2; // of the newest drawing in the mean

export class Resolution {
  /** Of the screen's own resolution, kLeast..1. */
  scale = 1;
  private mean_ms = 0;
  private count = 0;
  private passed_ms = 0; // in as many drawings

  /** One drawing of a moving picture took `ms`. True where the scale has changed. */
  took(ms: number): boolean {
    this.passed_ms += ms;
    const isLong = ++this.count > 1 && this.passed_ms > kLong_ms;
    if (this.count <= kIgnored && !isLong) return false;
    this.mean_ms = this.count <= kIgnored + 1 ? ms : this.mean_ms + kWeight * (ms - this.mean_ms);
    if (this.count < kIgnored + kEnough && !isLong) return false;
    const scale =
      this.mean_ms > kSlow_ms
        ? Math.max(kLeast, this.scale * Math.min(kStep, Math.sqrt(kSlow_ms / this.mean_ms)))
        : this.mean_ms < kFast_ms
          ? Math.min(1, this.scale / kStep)
          : this.scale;
    if (scale === this.scale) return false;
    this.scale = scale;
    this.count = this.passed_ms = 0;
    return true;
  }
}

export interface Graphics {
  inSoftware: boolean; // the processor draws, as far as the browser tells
  ofWorkers: boolean; // workers may draw
}

/** There is no WebGL 2. */
export class NoGraphics extends Error {}

/** Null: there is no WebGL 2. */
export function findGraphics(): Graphics | null {
  const far = hasOffscreen() ? new OffscreenCanvas(1, 1).getContext('webgl2') : null;
  const gl = far ?? document.createElement('canvas').getContext('webgl2');
  if (gl === null) return null;
  const names = gl.getExtension('WEBGL_debug_renderer_info');
  const name = String(gl.getParameter(names?.UNMASKED_RENDERER_WEBGL ?? gl.RENDERER));
  gl.getExtension('WEBGL_lose_context')?.loseContext();
  return { inSoftware: /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name), ofWorkers: far !== null };
}
