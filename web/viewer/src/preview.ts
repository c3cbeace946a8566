// SPDX-License-Identifier: Apache-2.0
// A small picture of the frame under the cursor of a time line: its texture, which still pictures bring with
// every frame and video with key frames. One is read at a time, the last one wished for, and kept; what plays
// goes before.
import { make, setText, windowOf } from './dom';
import { kTextureH264, kTextureJpeg, kTexturePng, kTextureWebp, parseFrame, type Frame } from './frame';
import type { FrameStore } from './frameStore';
import { frameAt } from './playback';
import { VideoTextures } from './videoTexture';

const kWidth = 168; // pixels of the page
const kPerPicture = 6; // pixels of the track, at least: nobody tells nearer frames apart
const kMostKept = 120;
const kRestMs = 60; // the cursor stays for so long before anything is read
const kStills: Record<number, string> = {
  [kTextureJpeg]: 'image/jpeg',
  [kTextureWebp]: 'image/webp',
  [kTexturePng]: 'image/png',
};

interface Kept {
  bitmap: ImageBitmap | null; // null: it has no picture
  number: number; // the camera's
}

export class Preview {
  private readonly canvas = make('canvas');
  private readonly time = make('span');
  private readonly box = make('div', { className: 'preview', hidden: true }, this.canvas, this.time);
  private readonly kept = new Map<number, Kept>(); // by index, the latest use last
  private readonly videos = new VideoTextures();
  private store: FrameStore | null = null;
  private wished: number | null = null;
  private reading = false;
  private timer = 0;
  private readonly page: Window; // that shows it

  constructor(track: HTMLElement) {
    this.page = windowOf(track);
    this.box.setAttribute('aria-hidden', 'true'); // the slider says its time
    track.append(this.box);
  }

  /** Of these frames from now on. */
  of(store: FrameStore): void {
    if (store === this.store) return;
    this.forget();
    this.store = store;
  }

  /** The frame shown at `atMs`, `x` pixels along a track that is `width` long. */
  show(atMs: number, time: string, x: number, width: number): void {
    const { times, first } = this.store!;
    if (times.length === 0) return;
    setText(this.time, time);
    this.box.hidden = false;
    const half = this.box.offsetWidth / 2;
    this.box.style.left = `${Math.min(Math.max(x, half), Math.max(half, width - half))}px`;
    const together = Math.max(1, Math.floor((times.length * kPerPicture) / width));
    const index = first + frameAt(times, atMs);
    this.wish(Math.max(first, index - (index % together)));
  }

  hide(): void {
    this.box.hidden = true;
    this.wished = null;
    this.page.clearTimeout(this.timer);
  }

  /** Holds none of the frames any more. */
  leave(): void {
    this.forget();
    this.store = null;
  }

  /** For good. */
  end(): void {
    this.leave();
    this.videos.end();
  }

  private forget(): void {
    for (const { bitmap } of this.kept.values()) bitmap?.close();
    this.kept.clear();
    this.hide();
  }

  private wish(index: number): void {
    const known = this.kept.get(index);
    if (known !== undefined) {
      this.wished = null;
      this.kept.delete(index);
      this.kept.set(index, known);
      return this.draw(index, known);
    }
    if (this.wished === index) return;
    this.wished = index;
    this.page.clearTimeout(this.timer);
    this.timer = this.page.setTimeout(() => void this.next(), kRestMs);
  }

  private async next(): Promise<void> {
    const { store, wished } = this;
    if (this.reading || wished === null || store === null) return;
    this.reading = true;
    const made = await this.read(store, wished).catch(() => null);
    this.reading = false;
    if (store !== this.store) {
      made?.bitmap?.close();
    } else {
      if (made !== null) this.kept.set(wished, made); // else it is damaged, or came too late: the next move tries again
      this.drop();
      if (this.wished === wished) {
        this.wished = null;
        this.draw(wished, made ?? { bitmap: null, number: -1 });
      }
    }
    void this.next();
  }

  private async read(store: FrameStore, index: number): Promise<Kept> {
    let frame = await frameOf(store, index);
    if (frame.textureCodec === kTextureH264 && !frame.isKey) {
      const key = await store.keyBefore(index);
      if (key === null) return { bitmap: null, number: -1 };
      frame = await frameOf(store, key);
    }
    const number = Number(frame.header.number);
    const bitmap = await this.decode(frame);
    if (bitmap === null) return { bitmap, number };
    const small = {
      resizeWidth: Math.min(bitmap.width, Math.round(kWidth * Math.min(this.page.devicePixelRatio, 2))),
    };
    const made = await createImageBitmap(bitmap, { ...small, resizeQuality: 'medium' });
    bitmap.close();
    return { bitmap: made, number };
  }

  private async decode({ texture, textureCodec, header }: Frame): Promise<ImageBitmap | null> {
    if (textureCodec === kTextureH264) {
      return VideoTextures.possible ? this.videos.decode(texture, header.textureWidth, header.textureHeight) : null;
    }
    const type = kStills[textureCodec];
    return type === undefined ? null : createImageBitmap(new Blob([texture as Uint8Array<ArrayBuffer>], { type }));
  }

  private drop(): void {
    for (const [index, { bitmap }] of this.kept) {
      if (this.kept.size <= kMostKept) return;
      bitmap?.close();
      this.kept.delete(index);
    }
  }

  private draw(index: number, { bitmap, number }: Kept): void {
    const { canvas } = this;
    canvas.hidden = bitmap === null;
    if (bitmap === null) return;
    canvas.width = bitmap.width;
    canvas.height = bitmap.height;
    canvas.style.aspectRatio = `${bitmap.width} / ${bitmap.height}`;
    canvas.getContext('2d')!.drawImage(bitmap, 0, 0);
    canvas.dataset['index'] = String(index);
    canvas.dataset['frame'] = String(number);
  }
}

async function frameOf(store: FrameStore, index: number): Promise<Frame> {
  const { prefix, message } = await store.read(index);
  return parseFrame(new Uint8Array(message, prefix.bytes));
}
