// SPDX-License-Identifier: Apache-2.0
// A small picture of each stream: of one frame of it, by the same decoder as every other. One stream at a time.
import { closePictures } from './frameMemory';
import { LiveSource } from './liveSource';
import { openRemote } from './openFile';
import { Session } from './session';
import type { SourceEvents } from './source';

export const kThumbnail = { width: 88, height: 66 }; // pixels of the page
const kPatienceMs = 5000; // with a stream that sends nothing
const kTries = 3; // of a recording, each twice as long, behind the others: a slow page may need it

interface Job {
  stream: string | null; // null: a recording of the folder
  recording: string | null; // that the stream is played from
  onto: HTMLCanvasElement;
  tries?: number; // in vain
}

export class Thumbnails {
  private session: Session | null = null; // while there is something to do
  private jobs: Job[] = [];
  private timer = 0;

  /** Drawn when it has come; nothing where the stream has no picture. */
  ask(job: Job): void {
    if (this.jobs.some(({ onto }) => onto === job.onto)) return;
    this.jobs.push(job);
    if (this.jobs.length === 1) void this.begin();
  }

  /** It is not to be drawn any more, unless it is under way. */
  forget(onto: HTMLCanvasElement): void {
    this.jobs = this.jobs.filter((job, i) => i === 0 || job.onto !== onto);
  }

  /** Forgets what is not drawn yet. */
  stop(): void {
    this.jobs = [];
    this.end();
  }

  private async begin(): Promise<void> {
    const job = this.jobs[0];
    if (job === undefined) return this.end();
    const session = (this.session ??= new Session({
      changed: () => undefined,
      described: () => undefined,
      ready: () => this.take(),
      hint: () => undefined,
      unusable: () => this.stop(),
    }));
    window.clearTimeout(this.timer);
    const { stream, recording, tries = 0 } = job;
    this.timer = window.setTimeout(() => this.giveUp({ ...job, tries: tries + 1 }), kPatienceMs * 2 ** tries);
    const opened = recording === null ? null : await openRemote(new URL(recording, document.baseURI)).catch(() => null);
    if (this.jobs[0] !== job) return;
    if (opened !== null) session.watch(opened.source);
    else if (stream !== null) session.watch((events) => pictureAlone(stream, events));
    // Else it waits: what did not come may come later.
  }

  private take(): void {
    const frame = this.session?.take() ?? null;
    const job = this.jobs[0];
    if (frame === null || job === undefined) return;
    if (frame.texture !== null) drawThumbnail(frame.texture, job.onto);
    closePictures(frame);
    this.next();
  }

  private giveUp(job: Job): void {
    if (job.recording !== null && job.tries! < kTries && job.onto.isConnected) this.jobs.push(job);
    this.next();
  }

  private next(): void {
    this.session?.watch(null);
    this.jobs.shift();
    void this.begin();
  }

  private end(): void {
    window.clearTimeout(this.timer);
    this.session?.end();
    this.session = null;
  }
}

/** In the lowest quality that the stream has. */
function pictureAlone(stream: string, events: SourceEvents): LiveSource {
  const source = new LiveSource(stream, events);
  source.want('texture');
  return source;
}

/** Filling it, the middle of the picture. */
export function drawThumbnail(picture: ImageBitmap, onto: HTMLCanvasElement): void {
  const scale = Math.max(onto.width / picture.width, onto.height / picture.height);
  const [width, height] = [picture.width * scale, picture.height * scale];
  const context = onto.getContext('2d')!;
  context.imageSmoothingQuality = 'high';
  context.drawImage(picture, (onto.width - width) / 2, (onto.height - height) / 2, width, height);
  onto.dataset['drawn'] = '1';
}
