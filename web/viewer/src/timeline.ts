// SPDX-License-Identifier: Apache-2.0
// The time line of a source that has one: playing, scrubbing, speed, a range to repeat, marks of key frames and gaps.
import { button, make, setText, windowOf } from './dom';
import { clockText, frameAt, kSpeeds, type Loop } from './playback';
import type { Preview } from './preview';
import type { Playback } from './source';
import { text } from './strings';

const say = text.timeline;
const kRefreshMs = 60;
const kLongGap = 5; // frames lost in a row, which a person sees
const kInset = 8; // pixels of the track on both sides of its times, half the slider's thumb
const kMarksMs = 250; // between drawings of the marks, which move while a stream is live

export class Timeline {
  private readonly track = make('canvas', {});
  private readonly slider = make('input', { type: 'range', min: '0', step: 'any' });
  private readonly playButton = button('', '', () => this.toggle());
  private readonly time = button('', say.time, () => this.toggleTime());
  private readonly live = button(say.live, '', () => this.playback?.follow());
  private readonly speed = make('select', { title: say.speed });
  private readonly range = button(say.range, say.rangeTitle, () => this.cycleLoop());
  private readonly streams = make('select', { hidden: true, className: 'stream' });
  private offered = '';
  private playback: Playback | null = null;
  private begun: Loop | null = null; // without an end of its own yet: what is there grows beyond it
  private absolute = false;
  private dirty = false;
  private readonly timer: number;
  private readonly sizes: ResizeObserver;
  private marksAt = 0; // when they were drawn
  private readonly page: Window & typeof globalThis; // that shows it: one in the background has late timers
  private preview: Preview | null = null; // loaded when it is first wanted
  private pointedX: number | null = null; // of the cursor, on the page

  constructor(
    private readonly box: HTMLElement,
    /** `chosen` gets the name of one that was offered beside the first; null: the first. */
    chosen: (name: string | null) => void = () => undefined,
  ) {
    this.page = windowOf(box);
    this.slider.setAttribute('aria-label', say.slider);
    this.speed.setAttribute('aria-label', say.speed);
    for (const speed of kSpeeds) this.speed.append(make('option', { value: String(speed) }, `${speed}×`));
    this.streams.setAttribute('aria-label', say.stream);
    this.streams.onchange = () => chosen(this.streams.selectedIndex === 0 ? null : this.streams.value);
    this.slider.oninput = () => this.playback?.seek(Number(this.slider.value));
    this.speed.onchange = () => this.playback?.setSpeed(Number(this.speed.value));
    const track = make('div', { className: 'track' }, this.track, this.slider);
    const steps = [button('‹', say.back, () => this.playback?.step(-1)), button('›', say.ahead, () => this.playback?.step(1))];
    track.onpointermove = track.onpointerenter = (event) => this.point(track, event.clientX);
    track.onpointerleave = () => this.unpoint();
    this.live.id = 'follow';
    this.time.className = 'time';
    this.box.append(this.streams, this.playButton, ...steps, track, this.time, this.live, this.speed, this.range);
    this.sizes = new this.page.ResizeObserver(() => (this.dirty = true));
    this.sizes.observe(this.track);
    this.timer = this.page.setInterval(() => this.refresh(), kRefreshMs);
  }

  /** For good. */
  stop(): void {
    this.page.clearInterval(this.timer);
    this.sizes.disconnect();
    this.preview?.end();
  }

  /** The streams that it can be of, by name, and how each is called, the first one first; none: there is no choice. `chosen` null: the first. */
  offer(streams: ReadonlyMap<string, string>, chosen: string | null): void {
    this.streams.hidden = streams.size < 2;
    const offered = JSON.stringify([...streams]);
    if (offered !== this.offered) {
      this.offered = offered;
      this.streams.replaceChildren(...[...streams].map(([value, called]) => make('option', { value }, called)));
    }
    const at = Math.max(0, [...streams.keys()].indexOf(chosen ?? ''));
    if (this.streams.selectedIndex !== at) this.streams.selectedIndex = at;
    this.streams.title = `${say.stream}: ${this.streams.value}`; // where there is no room for its name
  }

  /** Also again and again: nothing happens where it is the one shown. */
  show(playback: Playback | null): void {
    if (playback === this.playback) return;
    this.playback = playback;
    if (playback !== null) playback.changed = () => (this.dirty = true);
    this.dirty = true;
    this.marksAt = 0;
    this.unpoint();
    this.preview?.leave();
    this.refresh();
  }

  // A picture of the frame under the cursor.
  private point(track: HTMLElement, x: number): void {
    const wasOut = this.pointedX === null;
    this.pointedX = x;
    if (this.preview !== null) return this.showPreview(track);
    if (!wasOut) return;
    const loaded = import('./preview').then(({ Preview }) => {
      this.preview ??= new Preview(track);
      this.showPreview(track);
    });
    loaded.catch(() => (this.pointedX = null)); // the server has gone: tried again with the next move
  }

  private unpoint(): void {
    this.pointedX = null;
    this.preview?.hide();
  }

  private showPreview(track: HTMLElement): void {
    const p = this.playback;
    if (p === null || this.pointedX === null || this.isEmpty) return;
    const { left, width } = track.getBoundingClientRect();
    const share = Math.min(1, Math.max(0, (this.pointedX - left - kInset) / Math.max(1, width - 2 * kInset)));
    const atMs = this.begin + share * (this.end - this.begin);
    this.preview!.of(p.store);
    this.preview!.show(atMs, this.timeText(p, atMs), this.pointedX - left, width);
  }

  /** True where the key is one of the time line's. */
  command(key: string): boolean {
    const p = this.playback;
    if (p === null || this.isEmpty) return false;
    const faster = (by: number): void => {
      const at = kSpeeds.findIndex((s) => s >= p.speed);
      p.setSpeed(kSpeeds[Math.min(kSpeeds.length - 1, Math.max(0, at + by))]!);
    };
    const commands: Record<string, () => void> = {
      ' ': () => this.toggle(),
      ',': () => p.step(-1),
      '.': () => p.step(1),
      '<': () => faster(-1),
      '>': () => faster(1),
      home: () => p.seek(this.begin),
      end: () => (p.following === null ? p.seek(Infinity) : p.follow()),
      l: () => p.follow(),
      '[': () => p.setLoop({ from: p.position, to: p.loop?.to ?? this.end }),
      ']': () => p.setLoop({ from: p.loop?.from ?? this.begin, to: p.position }),
      '\\': () => p.setLoop(null),
    };
    commands[key]?.();
    return commands[key] !== undefined;
  }

  // A stream that has just begun has nothing to go back to.
  private get isEmpty(): boolean {
    return this.playback === null || this.playback.times.length < 2;
  }
  private get begin(): number {
    return this.playback!.times[0]!;
  }
  private get end(): number {
    const { times } = this.playback!;
    return times[times.length - 1]!;
  }

  private toggle(): void {
    if (this.playback?.playing === true) this.playback.pause();
    else this.playback?.play();
  }

  private toggleTime(): void {
    this.absolute = !this.absolute;
    this.dirty = true;
  }

  // Its start, then its end, then none.
  private cycleLoop(): void {
    const p = this.playback!;
    const hasEnd = p.loop !== null && p.loop !== this.begun && p.loop.to < this.end;
    if (p.loop === null) p.setLoop((this.begun = { from: p.position, to: this.end }));
    else if (!hasEnd && p.position > p.loop.from) p.setLoop({ from: p.loop.from, to: p.position });
    else p.setLoop(null);
  }

  private refresh(): void {
    const p = this.playback;
    const { isEmpty } = this;
    this.box.hidden = isEmpty && this.streams.hidden; // another one may be chosen
    this.box.classList.toggle('empty', isEmpty);
    if (p === null || isEmpty || (!this.dirty && !p.playing)) return;
    this.slider.min = String(this.begin);
    this.slider.max = String(this.end);
    const position = p.position;
    if (!this.slider.matches(':active')) this.slider.value = String(position);
    const frame = frameAt(p.times, position);
    const time = this.timeText(p, p.following === true ? this.end : position);
    this.slider.setAttribute('aria-valuetext', say.at(time, frame + 1, p.times.length));
    setText(this.time, time);
    this.time.setAttribute('aria-label', `${time}. ${say.time}`); // who speaks to the page says what is seen
    const label = p.playing ? say.pause : say.play;
    setText(this.playButton, p.playing ? '❚❚' : '▶');
    this.playButton.title = label;
    this.playButton.setAttribute('aria-label', label);
    this.range.setAttribute('aria-pressed', String(p.loop !== null));
    this.live.hidden = p.following === null;
    this.live.setAttribute('aria-pressed', String(p.following === true));
    this.live.title = p.following === true ? say.isLive : say.goLive;
    if (this.speed.value !== String(p.speed)) this.speed.value = String(p.speed);
    const now = performance.now();
    if (this.dirty && (p.following === null || now - this.marksAt >= kMarksMs)) {
      this.marksAt = now;
      this.drawMarks(p);
      this.dirty = false;
    }
  }

  private timeText(p: Playback, position: number): string {
    if (this.absolute) return absoluteText(p.startMs + position);
    if (p.newestMs === null) return `${clockText(position)} / ${clockText(this.end)}`;
    return say.behind(clockText(Math.max(0, p.newestMs - p.startMs - position)));
  }

  private drawMarks(p: Playback): void {
    const ratio = Math.min(windowOf(this.track).devicePixelRatio, 2);
    const [width, height] = [this.track.clientWidth * ratio, this.track.clientHeight * ratio];
    this.track.width = width;
    this.track.height = height;
    const c = this.track.getContext('2d')!;
    const style = getComputedStyle(this.track);
    const { begin } = this;
    const at = (ms: number): number => ((ms - begin) / Math.max(1, this.end - begin)) * width;
    if (p.loop !== null) {
      c.fillStyle = style.getPropertyValue('--hover');
      c.fillRect(at(p.loop.from), 0, at(p.loop.to) - at(p.loop.from), height);
      c.fillStyle = style.getPropertyValue('--accent');
      for (const edge of [p.loop.from, p.loop.to]) c.fillRect(at(edge) - ratio, 0, 2 * ratio, height);
    }
    for (let i = 0; i < p.times.length; ++i) {
      const lost = p.gapBefore(p.first + i);
      const gap = lost > 0;
      if (!gap && p.isKey(p.first + i) !== true) continue;
      c.fillStyle = style.getPropertyValue(gap ? '--bad' : '--quiet');
      const tall = lost >= kLongGap ? height : (gap ? 9 : 4) * ratio;
      c.fillRect(at(p.times[i]!) - ratio / 2, height - tall, gap ? 2 * ratio : ratio, tall);
    }
  }
}

const absoluteText = (utcMs: number): string => new Date(utcMs).toISOString().replace('T', ' ').replace('Z', ' UTC');
