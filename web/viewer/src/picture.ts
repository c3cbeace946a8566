// SPDX-License-Identifier: Apache-2.0
// The camera's picture beside the surface, and in it the place under the cursor.
import { element, setText } from './dom';
import { text } from './strings';

const kMark = 9; // pixels of the page

export class Picture {
  private readonly canvas = element<HTMLCanvasElement>('picture');
  private readonly note = element('picture-note');
  private readonly context = this.canvas.getContext('2d')!;
  private bitmap: ImageBitmap | null = null;
  private mark: [number, number] | null = null;
  private wanted = false;

  set on(on: boolean) {
    if (on === this.wanted) return;
    this.wanted = on;
    this.draw();
  }

  /** Open until the next one is shown. */
  show(bitmap: ImageBitmap | null): void {
    this.bitmap = bitmap;
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
    const { bitmap, context: c, canvas } = this;
    setText(this.note, bitmap === null ? text.noPicture : '');
    if (bitmap === null) {
      c.clearRect(0, 0, canvas.width, canvas.height);
      return;
    }
    if (canvas.width !== bitmap.width || canvas.height !== bitmap.height) {
      canvas.width = bitmap.width;
      canvas.height = bitmap.height;
    }
    c.drawImage(bitmap, 0, 0);
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
