// SPDX-License-Identifier: Apache-2.0
// Figures on the stream in full: rates, sizes, where the time goes, where frames are lost.
import { make, setText } from './dom';
import { kParts, kStages } from './journal';
import { grouped, type Meter } from './meter';
import { plot, type Line } from './plot';
import type { StreamStatus } from './protocol';
import type { Kept } from './source';
import { text } from './strings';
import { VideoTextures } from './videoTexture';

const say = text.statistics;
const kEveryMs = 500;

export class StatisticsPanel {
  private readonly values = new Map<string, HTMLElement>();
  private readonly plot = make('canvas', { className: 'plot' });
  private timer = 0;

  constructor(
    private readonly body: HTMLElement,
    private readonly meter: Meter,
    private readonly status: () => StreamStatus | null,
    private readonly kept: () => Kept | null,
    private readonly detail: () => string | null,
  ) {
    this.plot.setAttribute('role', 'img');
    this.plot.setAttribute('aria-label', say.plot);
    this.section(say.stream, ['rate', 'bits', 'detail', 'codecs', 'vertices']);
    this.section(say.sizes, [...kParts]);
    this.section(say.latency, ['total', ...kStages]);
    body.append(this.plot);
    this.section(say.drops, ['serverDrops', 'link', 'viewer', 'gaps']);
    this.section(say.machines, ['reconstruct', 'encode', 'decodeTime', 'clock']);
    this.section(say.kept, ['keptTime', 'keptBytes']);
  }

  set open(open: boolean) {
    window.clearInterval(this.timer);
    if (!open) return;
    this.timer = window.setInterval(() => this.refresh(), kEveryMs);
    this.refresh();
  }

  private section(title: string, names: (keyof typeof say.names)[]): void {
    const list = make('dl', { className: 'figures' });
    for (const name of names) {
      const value = make('dd', {}, '–');
      this.values.set(name, value);
      const term = make('dt', {}, say.names[name]);
      const stage = kStages.findIndex((s) => s === name);
      if (stage >= 0) term.className = `stage stage-${stage}`;
      list.append(term, value);
    }
    this.body.append(make('h3', {}, title), list);
  }

  private set(name: keyof typeof say.names, value: string | null): void {
    setText(this.values.get(name)!, value ?? '–');
  }

  private refresh(): void {
    const now = performance.now();
    const { journal, clock } = this.meter;
    const figures = this.meter.figures(now);
    const status = this.status();
    const ms = (value: number | null | undefined): string | null =>
      value === null || value === undefined ? null : `${value.toFixed(1)} ms`;
    this.set('rate', `${figures.rate.toFixed(1)} /s`);
    this.set('bits', `${(figures.bits / 1e6).toFixed(2)} Mbit/s`);
    this.set('detail', this.detail());
    const chosen = !VideoTextures.possible && status?.rungs?.some(({ quality }) => quality === 'full-jpeg') === true;
    const codecs = `${journal.codecs}${chosen ? say.insteadOfVideo : ''}${journal.isKey ? '' : say.delta}`;
    this.set('codecs', journal.codecs === '' ? null : codecs);
    this.set('vertices', `${grouped(figures.vertices)}, ${grouped(figures.triangles)}`);
    const total = journal.parts === null ? 0 : kParts.reduce((sum, part) => sum + journal.parts![part], 0);
    for (const part of kParts) {
      const bytes = journal.parts?.[part];
      this.set(part, bytes === undefined ? null : `${(bytes / 1000).toFixed(1)} kB, ${Math.round((100 * bytes) / total)} %`);
    }
    const medians = journal.medians();
    for (const stage of kStages) this.set(stage, ms(medians?.[stage]));
    this.set('total', ms(medians === null ? null : kStages.reduce((sum, stage) => sum + medians[stage], 0)));
    this.set('serverDrops', status === null ? null : say.serverDrops(status));
    for (const place of ['link', 'viewer', 'gaps'] as const) this.set(place, String(figures.drops[place]));
    this.set('reconstruct', ms(status?.reconstruct_ms));
    this.set('encode', ms(status?.encode_ms));
    this.set('decodeTime', ms(figures.decodeMs));
    const [offset, trip] = [clock.get(), clock.roundTrip()];
    this.set('clock', offset === null || trip === null ? null : `${offset.toFixed(1)} ± ${(trip / 2).toFixed(1)} ms`);
    this.showKept();
    this.drawPlot();
  }

  private showKept(): void {
    const kept = this.kept();
    const seconds = (ms: number): string => `${Math.round(ms / 1000)} s`;
    const megabytes = (bytes: number): string => `${Math.round(bytes / 1e6)} MB`;
    this.set('keptTime', kept && say.keptOf(seconds(kept.spanMs), seconds(kept.limits.ms)));
    this.set('keptBytes', kept && say.keptOf(megabytes(kept.bytes), megabytes(kept.limits.bytes)));
  }

  // One stage upon the other, frame by frame.
  private drawPlot(): void {
    const { stages } = this.meter.journal;
    this.plot.hidden = stages.length < 2;
    if (stages.length < 2) return;
    const sums = stages.map(() => 0);
    const lines = kStages.map((stage, i): Line => {
      const points = stages.map((s, frame) => [frame - stages.length + 1, (sums[frame]! += s[stage])] as const);
      return { points, colour: `--stage-${i}` };
    });
    const sorted = [...sums].sort((a, b) => a - b);
    const most = 1.15 * sorted[Math.floor(0.97 * (sorted.length - 1))]!;
    plot(this.plot, { x: { from: 1 - stages.length, to: 0 }, y: { from: 0, to: Math.max(1, most) }, unit: 'ms' }, lines);
  }
}
