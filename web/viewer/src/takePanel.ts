// SPDX-License-Identifier: Apache-2.0
// Taking away what is seen: a picture, a video, the surface, a range of frames, a link. Loaded when it is opened first,
// the writers when they are needed.
import { button, make, setText } from './dom';
import { copy, download, fileName } from './download';
import type { StreamInfo } from './protocol';
import { RangeCard } from './rangeCard';
import type { Running } from './recordControl';
import type { Playback } from './source';
import { text } from './strings';
import { askBeforeLeaving, mayLeave } from './unsaved';
import type { View } from './view';

const say = text.take;
const kVideoTypes = ['video/webm;codecs=vp9', 'video/webm;codecs=vp8', 'video/webm', 'video/mp4'];
const kVideoRate = 30;

/** What there is to take away now. */
export interface Takeable {
  readonly view: View;
  /** Of the stream or file shown. */
  name(): string | null;
  /** To what is seen now. */
  link(): string;
  playback(): Playback | null;
  info(): StreamInfo | null;
  /** A video runs; null: no more. */
  filming(video: Running | null): void;
}

export class TakePanel {
  private readonly status = make('p', { className: 'quiet' });
  private readonly video: HTMLButtonElement;
  private recorder: MediaRecorder | null = null;

  constructor(
    body: HTMLElement,
    private readonly of: Takeable,
  ) {
    this.status.setAttribute('role', 'status');
    const guarded = (act: () => Promise<void>) => () =>
      void act().catch((error: unknown) => setText(this.status, error instanceof Error ? error.message : String(error)));
    this.video = button(say.video, say.videoTitle, guarded(() => this.toggleVideo()));
    this.video.hidden = typeof MediaRecorder === 'undefined';
    const row = (...buttons: HTMLElement[]): HTMLElement => make('div', { className: 'buttons' }, ...buttons);
    const range = new RangeCard(of, (words) => setText(this.status, words));
    body.append(
      make('h3', {}, say.picture),
      row(button(say.screenshot, say.screenshotTitle, guarded(() => this.screenshot())), this.video),
      make('h3', {}, say.surface),
      row(button('PLY', say.ply, guarded(() => this.ply())), button('GLB', say.glb, guarded(() => this.glb()))),
      range.root,
      make('h3', {}, say.link),
      row(button(say.copyLink, say.linkTitle, guarded(() => this.share()))),
      this.status,
    );
  }

  private async screenshot(): Promise<void> {
    const blob = await this.of.view.png();
    if (blob !== null) this.save(blob, 'png');
  }

  private async toggleVideo(): Promise<void> {
    if (this.recorder !== null) return this.recorder.stop();
    const { view } = this.of;
    const type = kVideoTypes.find((t) => MediaRecorder.isTypeSupported(t));
    if (type === undefined) return setText(this.status, say.noVideo);
    this.video.disabled = true; // until it has begun
    try {
      // A video has no transparency: it gets the page's ground.
      await view.film(getComputedStyle(document.documentElement).getPropertyValue('--ground').trim());
      this.record(type);
    } catch (error) {
      view.endFilm();
      throw error;
    } finally {
      this.video.disabled = false;
    }
  }

  private record(type: string): void {
    const { view } = this.of;
    const recorder = new MediaRecorder(view.canvas.captureStream(kVideoRate), { mimeType: type });
    const parts: Blob[] = [];
    const video: Running = { bytes: 0, since: performance.now() };
    recorder.ondataavailable = ({ data }) => {
      parts.push(data);
      video.bytes += data.size;
      setText(this.status, say.filmed(video.bytes));
    };
    recorder.onstop = () => {
      this.recorder = null;
      view.endFilm();
      this.of.filming(null);
      setText(this.video, say.video);
      this.video.setAttribute('aria-pressed', 'false');
      mayLeave(video);
      if (video.bytes === 0) return setText(this.status, say.noVideo); // though it says that it can
      this.save(new Blob(parts, { type }), type.includes('mp4') ? 'mp4' : 'webm');
    };
    recorder.start(1000);
    this.recorder = recorder;
    askBeforeLeaving(video);
    this.of.filming(video);
    setText(this.video, say.videoStop);
    this.video.setAttribute('aria-pressed', 'true');
  }

  private async ply(): Promise<void> {
    const { plyOf } = await import('./surfaceFiles');
    this.save(new Blob([plyOf(this.shown())]), 'ply');
  }

  private async glb(): Promise<void> {
    const { glbOf } = await import('./surfaceFiles');
    this.save(new Blob([await glbOf(this.shown())]), 'glb');
  }

  private async share(): Promise<void> {
    const link = this.of.link();
    setText(this.status, (await copy(link)) ? say.copied : link);
  }

  private shown(): NonNullable<View['shown']> {
    const frame = this.of.view.shown;
    if (frame === null) throw new Error(say.nothing);
    frame.kept = true; // it is written while others are shown
    return frame;
  }

  private save(content: Blob, extension: string): void {
    const name = fileName(this.of.name(), this.of.view.shown?.number ?? null, extension);
    download(name, content);
    setText(this.status, say.saved(name, content.size));
  }
}
