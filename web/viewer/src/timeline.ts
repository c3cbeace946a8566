// SPDX-License-Identifier: Apache-2.0
// The time line of a source that has one: playing, scrubbing, speed, a range to repeat, marks of key frames and gaps.
import { button, element, make, setText } from './dom';
import { clockText, frameAt, kSpeeds } from './playback';
import type { Playback } from './source';
import { text } from './strings';

const say = text.timeline;
const kRefreshMs = 60;

export class Timeline {
  private readonly box = element('timeline');
  private readonly track = make('canvas', {});
  private readonly slider = make('input', { type: 'range', min: '0', step: 'any' });
  private readonly playButton = button('', '', () => this.toggle());
  private readonly time = button('', say.time, () => this.toggleTime());
  private readonly speed = make('select', { title: say.speed });
  private readonly range = button(say.range, say.rangeTitle, () => this.cycleLoop());
  private playback: Playback | null = null;
  private absolute = false;
  private dirty = false;

  constructor() {
    this.slider.setAttribute('aria-label', say.slider);
    this.speed.setAttribute('aria-label', say.speed);
    for (const speed of kSpeeds) this.speed.append(make('option', { value: String(speed) }, `${speed}×`));
    this.slider.oninput = () => this.playback?.seek(Number(this.slider.value));
    this.speed.onchange = () => this.playback?.setSpeed(Number(this.speed.value));
    const track = make('div', { className: 'track' }, this.track, this.slider);
    const steps = [button('‹', say.back, () => this.playback?.step(-1)), button('›', say.ahead, () => this.playback?.step(1))];
    for (const b of steps) b.setAttribute('aria-label', b.title);
    this.box.append(this.playButton, ...steps, track, this.time, this.speed, this.range);
    new ResizeObserver(() => (this.dirty = true)).observe(this.track);
    window.setInterval(() => this.refresh(), kRefreshMs);
  }

  show(playback: Playback | null): void {
    this.playback = playback;
    this.box.hidden = playback === null;
    document.body.classList.toggle('with-timeline', playback !== null);
    if (playback === null) return;
    playback.changed = () => (this.dirty = true);
    this.dirty = true;
    this.slider.max = String(playback.times[playback.times.length - 1]!);
  }

  /** True where the key is one of the time line's. */
  command(key: string): boolean {
    const p = this.playback;
    if (p === null) return false;
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
      home: () => p.seek(0),
      end: () => p.seek(Infinity),
      '[': () => p.setLoop({ from: p.position, to: p.loop?.to ?? this.end }),
      ']': () => p.setLoop({ from: p.loop?.from ?? 0, to: p.position }),
      '\\': () => p.setLoop(null),
    };
    commands[key]?.();
    return commands[key] !== undefined;
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
    if (p.loop === null) p.setLoop({ from: p.position, to: this.end });
    else if (p.loop.to >= this.end && p.position > p.loop.from) p.setLoop({ from: p.loop.from, to: p.position });
    else p.setLoop(null);
  }

  private refresh(): void {
    const p = this.playback;
    if (p === null || (!this.dirty && !p.playing)) return;
    if (!this.slider.matches(':active')) this.slider.value = String(p.position);
    const frame = frameAt(p.times, p.position);
    this.slider.setAttribute('aria-valuetext', say.at(clockText(p.position), frame + 1, p.times.length));
    setText(this.time, this.absolute ? absoluteText(p.startMs + p.position) : `${clockText(p.position)} / ${clockText(this.end)}`);
    const label = p.playing ? say.pause : say.play;
    setText(this.playButton, p.playing ? '❚❚' : '▶');
    this.playButton.title = label;
    this.playButton.setAttribute('aria-label', label);
    this.range.setAttribute('aria-pressed', String(p.loop !== null));
    if (this.speed.value !== String(p.speed)) this.speed.value = String(p.speed);
    if (this.dirty) this.drawMarks(p);
    this.dirty = false;
  }

  private drawMarks(p: Playback): void {
    const ratio = Math.min(window.devicePixelRatio, 2);
    const [width, height] = [this.track.clientWidth * ratio, this.track.clientHeight * ratio];
    this.track.width = width;
    this.track.height = height;
    const c = this.track.getContext('2d')!;
    const style = getComputedStyle(this.track);
    const at = (ms: number): number => (ms / Math.max(1, this.end)) * width;
    if (p.loop !== null) {
      c.fillStyle = style.getPropertyValue('--hover');
      c.fillRect(at(p.loop.from), 0, at(p.loop.to) - at(p.loop.from), height);
      c.fillStyle = style.getPropertyValue('--accent');
      for (const edge of [p.loop.from, p.loop.to]) c.fillRect(at(edge) - ratio, 0, 2 * ratio, height);
    }
    for (let i = 0; i < p.times.length; ++i) {
      const gap = p.gapBefore(i) > 0;
      if (!gap && p.isKey(i) !== true) continue;
      c.fillStyle = style.getPropertyValue(gap ? '--bad' : '--quiet');
      const tall = gap ? height : 4 * ratio;
      c.fillRect(at(p.times[i]!) - ratio / 2, height - tall, gap ? 2 * ratio : ratio, tall);
    }
  }
}

const absoluteText = (utcMs: number): string => new Date(utcMs).toISOString().replace('T', ' ').replace('Z', ' UTC');
