// SPDX-License-Identifier: Apache-2.0
// A picture beside the surface, as the camera saw it, and in it the place under the cursor.
import { element, setText } from './dom';

const kMark = 9; // pixels of the page

export type Drawable = ImageBitmap | OffscreenCanvas;

export class Picture {
  private readonly canvas: HTMLCanvasElement;
  private readonly note: HTMLElement;
  private readonly context: CanvasRenderingContext2D;
  private picture: Drawable | null = null;
  private mark: [number, number] | null = null;
  private wanted = false;

  /** Of the page's elements `id` and `id-note`. */
  constructor(id: string) {
    this.canvas = element<HTMLCanvasElement>(id);
    this.note = element(`${id}-note`);
    this.context = this.canvas.getContext('2d')!;
  }

  set on(on: boolean) {
    if (on === this.wanted) return;
    this.wanted = on;
    this.draw();
  }
  get on(): boolean {
    return this.wanted;
  }

  /** The picture is the caller's, and open until the next one is shown. */
  show(picture: Drawable | null, note: string): void {
    this.picture = picture;
    setText(this.note, note);
    this.draw();
  }

  /** 0..1 from the upper left corner. */
  point(at: [number, number] | null): void {
    if (at === this.mark) return;
    this.mark = at;
    this.draw();
  }

  private draw(): void {
    if (!this.wanted) return;
    const { picture, context: c, canvas } = this;
    if (picture === null) {
      c.clearRect(0, 0, canvas.width, canvas.height);
      return;
    }
    if (canvas.width !== picture.width || canvas.height !== picture.height) {
      canvas.width = picture.width;
      canvas.height = picture.height;
    }
    c.drawImage(picture, 0, 0);
    if (this.mark === null) return;
    const scale = canvas.width / Math.max(1, canvas.clientWidth);
    const [x, y] = [this.mark[0] * canvas.width, this.mark[1] * canvas.height];
    for (const [colour, width] of [['#000', 4], ['#fff', 1.5]] as const) {
      c.strokeStyle = colour;
      c.lineWidth = width * scale;
      c.beginPath();
      c.arc(x, y, kMark * scale, 0, 2 * Math.PI);
      c.stroke();
    }
  }
}
