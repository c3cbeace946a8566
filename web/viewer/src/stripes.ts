// SPDX-License-Identifier: Apache-2.0
// The stripes beside the surface: as the camera sees them, which only the server that has it can show, and only now;
// else where they were read, which each surface says: its vertices lie on them.
import type { DecodedFrame } from './messages';
import { Picture } from './picture';
import { text } from './strings';

const say = text.stripes;
const kEveryMs = 150; // between pictures of the camera
const kAgainMs = 1000; // after one that did not come
const kShade = 0.35; // of the picture under the places where stripes were read
const kRead = [90, 230, 255];

export class Stripes {
  private readonly picture = new Picture('stripes');
  private stream: string | null = null; // whose camera the server has; null: it has none, or what is shown is not of now
  private running = false;
  private seen: ImageBitmap | null = null; // by the camera
  private frame: DecodedFrame | null = null; // is shown
  private canvas: OffscreenCanvas | null = null;

  set on(on: boolean) {
    if (on === this.picture.on) return;
    this.picture.on = on;
    this.refresh();
  }

  /** The camera of this stream from now on. */
  watch(stream: string | null): void {
    if (stream === this.stream) return;
    this.stream = stream;
    this.forget();
    this.refresh();
  }

  /** What is on the screen: its arrays are there until the next. */
  show(frame: DecodedFrame): void {
    this.frame = frame;
    if (this.picture.on && this.stream === null) this.drawRead();
  }

  point(at: [number, number] | null): void {
    this.picture.point(at);
  }

  private refresh(): void {
    if (!this.picture.on) return;
    if (this.stream === null) return this.drawRead();
    if (this.seen === null) this.picture.show(null, say.waiting);
    void this.run();
  }

  private async run(): Promise<void> {
    if (this.running) return;
    this.running = true;
    while (this.picture.on && this.stream !== null) {
      const waitMs = document.hidden ? kAgainMs : await this.once(this.stream).catch(() => kAgainMs);
      await new Promise((resolve) => window.setTimeout(resolve, waitMs));
    }
    this.running = false;
  }

  /** Milliseconds until the next. */
  private async once(stream: string): Promise<number> {
    const { lookAt, pictureOf } = await import('./rig/look');
    const look = await lookAt(stream, 'camera');
    if (look?.pictures.includes('camera') !== true) return kEveryMs;
    const bitmap = await pictureOf(stream, 'camera');
    if (bitmap === null) return kEveryMs;
    if (stream !== this.stream) {
      bitmap.close();
      return 0;
    }
    this.picture.show(bitmap, say.live);
    this.seen?.close();
    this.seen = bitmap;
    return kEveryMs;
  }

  private forget(): void {
    this.picture.show(null, '');
    this.seen?.close();
    this.seen = null;
  }

  private drawRead(): void {
    const { frame } = this;
    if (frame?.coordinates == null || frame.texture === null) return this.picture.show(null, frame === null ? '' : text.noPicture);
    const { width, height } = frame.texture;
    if (this.canvas?.width !== width || this.canvas.height !== height) this.canvas = new OffscreenCanvas(width, height);
    const c = this.canvas.getContext('2d', { willReadFrequently: true })!;
    c.globalAlpha = 1;
    c.fillRect(0, 0, width, height);
    c.globalAlpha = kShade;
    c.drawImage(frame.texture, 0, 0);
    const pixels = c.getImageData(0, 0, width, height);
    const { coordinates } = frame;
    for (let v = 0; v < coordinates.length; v += 2) {
      const [x, y] = [Math.floor(coordinates[v]! * width), Math.floor(coordinates[v + 1]! * height)];
      if (x >= 0 && y >= 0 && x < width && y < height) pixels.data.set(kRead, 4 * (y * width + x));
    }
    c.putImageData(pixels, 0, 0);
    this.picture.show(this.canvas, say.read);
  }
}
