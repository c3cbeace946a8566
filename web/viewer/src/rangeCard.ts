// SPDX-License-Identifier: Apache-2.0
// Taking away a range of the time line: what is repeated, or all there is; how far it is, and cancelling it.
import { button, make, setText } from './dom';
import { download, fileName } from './download';
import { clockText } from './playback';
import { framesBetween, kRangeFormats, type RangeFormat } from './rangeFrames';
import type { Playback } from './source';
import { text } from './strings';
import type { Takeable } from './takePanel';

const say = text.take;
const kRefreshMs = 250;

export class RangeCard {
  readonly root = make('div', { id: 'range' });
  private readonly what = make('p', { className: 'quiet' });
  private readonly progress = make('progress', { value: 0 });
  private readonly starts: HTMLElement;
  private readonly running: HTMLElement;
  private job: AbortController | null = null;

  /** `told` gets what to tell a person. */
  constructor(
    private readonly of: Pick<Takeable, 'name' | 'playback' | 'info'>,
    private readonly told: (words: string) => void,
  ) {
    const start = (format: RangeFormat): HTMLElement =>
      button(say.rangeFormats[format], say.rangeTitles[format], () => void this.start(format));
    this.starts = make('div', { className: 'buttons' }, ...kRangeFormats.map(start));
    this.progress.setAttribute('aria-label', say.range);
    this.running = make('div', { className: 'row buttons' }, this.progress, button(say.cancel, say.cancelTitle, () => this.job?.abort()));
    this.root.append(make('h3', {}, say.range), this.what, this.starts, this.running);
    window.setInterval(() => this.show(), kRefreshMs);
    this.show();
  }

  private show(): void {
    const playback = this.of.playback();
    const count = playback?.times.length ?? 0;
    this.root.hidden = this.job === null && count < 2;
    this.starts.hidden = this.job !== null;
    this.running.hidden = this.job === null;
    if (playback === null || count === 0 || this.job !== null) return;
    const { from, to } = spanOf(playback);
    const [first, last] = framesBetween(playback.store, from, to);
    const begin = playback.times[0]!;
    const words = playback.loop === null ? say.rangeAll : say.rangeSet(clockText(from - begin), clockText(to - begin));
    setText(this.what, say.rangeOf(words, last - first + 1));
  }

  private async start(format: RangeFormat): Promise<void> {
    const playback = this.of.playback();
    if (this.job !== null || playback === null) return;
    const job = new AbortController();
    this.job = job;
    this.told('');
    this.progress.value = 0;
    this.show();
    try {
      const [{ exportRange }, { writeStreamInfo }] = await Promise.all([import('./rangeExport'), import('./cdrWriter')]);
      const store = playback.store.held();
      const { from, to } = spanOf(playback);
      const range = framesBetween(store, from, to);
      const info = this.of.info();
      this.progress.max = range[1] - range[0] + 1;
      const { content, frames, damaged } = await exportRange({
        store,
        range,
        format,
        description: info === null ? null : writeStreamInfo(info),
        progress: (done) => (this.progress.value = done),
        cancelled: job.signal,
      });
      job.signal.throwIfAborted();
      const name = fileName(this.of.name(), null, say.rangeEndings[format]);
      download(name, content);
      this.told(say.rangeSaved(name, frames, content.size, damaged));
    } catch (error) {
      this.told(job.signal.aborted ? say.rangeCancelled : say.rangeFailed(error instanceof Error ? error.message : String(error)));
    } finally {
      this.job = null;
      this.show();
    }
  }
}

function spanOf({ loop, times }: Playback): { from: number; to: number } {
  return loop ?? { from: times[0]!, to: times[times.length - 1]! };
}
