// SPDX-License-Identifier: Apache-2.0
// Taking away what is seen: a picture, a video, the surface, a link. The writers are loaded when they are needed.
import { button, make, setText } from './dom';
import { copy, download, fileName } from './download';
import type { Pixels } from './exportPly';
import { text } from './strings';
import type { View } from './view';

const say = text.take;
const kVideoTypes = ['video/webm;codecs=vp9', 'video/webm;codecs=vp8', 'video/webm', 'video/mp4'];
const kVideoRate = 30;
const kJpegQuality = 0.92;

export class TakePanel {
  private readonly status = make('p', { className: 'quiet' });
  private readonly video = button(say.video, say.videoTitle, () => this.toggleVideo());
  private recorder: MediaRecorder | null = null;

  /** `name`: of the stream or file shown; `link`: to what is seen now. */
  constructor(
    body: HTMLElement,
    private readonly view: View,
    private readonly name: () => string | null,
    private readonly link: () => string,
  ) {
    this.status.setAttribute('role', 'status');
    this.video.hidden = typeof MediaRecorder === 'undefined';
    const row = (...buttons: HTMLElement[]): HTMLElement => make('div', { className: 'buttons' }, ...buttons);
    const guarded = (act: () => Promise<void>) => () =>
      void act().catch((error: unknown) => setText(this.status, error instanceof Error ? error.message : String(error)));
    body.append(
      make('h3', {}, say.picture),
      row(button(say.screenshot, say.screenshotTitle, guarded(() => this.screenshot())), this.video),
      make('h3', {}, say.surface),
      row(button('PLY', say.ply, guarded(() => this.ply())), button('GLB', say.glb, guarded(() => this.glb()))),
      make('h3', {}, say.link),
      row(button(say.copyLink, say.linkTitle, guarded(() => this.share()))),
      this.status,
    );
  }

  private async screenshot(): Promise<void> {
    this.view.still();
    const blob = await new Promise<Blob | null>((resolve) => this.view.canvas.toBlob(resolve)); // of this very drawing
    if (blob !== null) this.save(blob, 'png');
  }

  private toggleVideo(): void {
    if (this.recorder !== null) return this.recorder.stop();
    const type = kVideoTypes.find((t) => MediaRecorder.isTypeSupported(t));
    if (type === undefined) return setText(this.status, say.noVideo);
    // A video has no transparency: it gets the page's ground.
    this.view.background = getComputedStyle(document.documentElement).getPropertyValue('--ground').trim();
    const recorder = new MediaRecorder(this.view.canvas.captureStream(kVideoRate), { mimeType: type });
    const parts: Blob[] = [];
    recorder.ondataavailable = (event) => parts.push(event.data);
    recorder.onstop = () => {
      this.recorder = null;
      this.view.background = null;
      setText(this.video, say.video);
      this.video.setAttribute('aria-pressed', 'false');
      this.save(new Blob(parts, { type }), type.includes('mp4') ? 'mp4' : 'webm');
    };
    recorder.start(1000);
    this.recorder = recorder;
    setText(this.video, say.videoStop);
    this.video.setAttribute('aria-pressed', 'true');
  }

  private async ply(): Promise<void> {
    const { writePly } = await import('./exportPly');
    const frame = this.shown();
    this.save(new Blob([writePly(frame, frame.texture === null ? null : pixelsOf(frame.texture))]), 'ply');
  }

  private async glb(): Promise<void> {
    const { writeGlb } = await import('./exportGlb');
    const frame = this.shown();
    const canvas = frame.texture === null ? null : drawn(frame.texture);
    const jpeg = await canvas?.convertToBlob({ type: 'image/jpeg', quality: kJpegQuality });
    this.save(new Blob([writeGlb(frame, jpeg === undefined ? null : new Uint8Array(await jpeg.arrayBuffer()))]), 'glb');
  }

  private async share(): Promise<void> {
    const link = this.link();
    setText(this.status, (await copy(link)) ? say.copied : link);
  }

  private shown(): NonNullable<View['shown']> {
    const frame = this.view.shown;
    if (frame === null) throw new Error(say.nothing);
    frame.kept = true; // it is written while others are shown
    return frame;
  }

  private save(content: Blob, extension: string): void {
    const name = fileName(this.name(), this.view.shown?.number ?? null, extension);
    download(name, content);
    setText(this.status, say.saved(name, content.size));
  }
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
