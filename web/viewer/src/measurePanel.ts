// SPDX-License-Identifier: Apache-2.0
// Measuring with the mouse or a finger: which tool, what was measured, and the place under the cursor.
import { button, element, make, setText } from './dom';
import { copy, download, fileName } from './download';
import {
  kSpots,
  kTools,
  lengthText,
  measure,
  measurementsCsv,
  sectionCsv,
  valueText,
  type Measurement,
  type Spot,
  type Tool,
} from './measure';
import type { Mark } from './overlay';
import { coordinatesAt, sigmaAt } from './pick';
import { plot } from './plot';
import { text } from './strings';
import type { View } from './view';

const kStill_px = 5; // a click moves no further
const say = text.measure;

export class MeasurePanel {
  private tool: Tool | null = null;
  private spots: Spot[] = [];
  readonly measurements: Measurement[] = [];
  private cursor: { x: number; y: number } | null = null;
  private pressed: { x: number; y: number } | null = null;
  private readonly tools: Map<Tool, HTMLButtonElement>;
  private readonly hint = make('p', { className: 'quiet' });
  private readonly list = make('ol', { className: 'measurements' });
  private readonly plot = make('canvas', { className: 'plot', hidden: true });
  private readonly readout = element('cursor');

  /** `pointed`: where in the camera's picture the cursor is. */
  constructor(
    body: HTMLElement,
    private readonly view: View,
    private readonly pointed: (at: [number, number] | null) => void,
  ) {
    this.tools = new Map(kTools.map((tool) => [tool, button(say.tools[tool], say.hints[tool], () => this.choose(tool))]));
    const group = make('div', { className: 'segments' }, ...this.tools.values());
    group.setAttribute('role', 'group');
    this.plot.setAttribute('role', 'img');
    this.plot.setAttribute('aria-label', say.plot);
    this.list.setAttribute('aria-live', 'polite');
    const copied = button(say.copy, say.copyTitle, () => {
      void copy(measurementsCsv(this.measurements).replaceAll(',', '\t')).then((done) => setText(this.hint, done ? say.copied : say.notCopied));
    });
    const csv = button(say.csv, say.csvTitle, () => this.save('measurements', measurementsCsv(this.measurements)));
    const section = button(say.sectionCsv, say.sectionCsvTitle, () => this.save('section', sectionCsv(this.lastSection?.profile ?? [])));
    const clear = button(say.clear, say.clear, () => this.clear());
    body.append(group, this.hint, this.list, this.plot, make('div', { className: 'buttons' }, copied, csv, section, clear));
    this.listen(view.canvas);
    this.refresh();
  }

  /** The panel is open or closed: measurements stay, clicks only count while it is open. */
  set open(open: boolean) {
    this.choose(open ? (this.tool ?? 'distance') : null);
    this.drawPlot();
  }
  get isOpen(): boolean {
    return this.tool !== null;
  }

  /** After each drawing of a new surface, and when the cursor moves. */
  readCursor(): void {
    const picked = this.cursor === null ? null : this.view.pick(this.cursor);
    const shown = this.view.shown;
    this.readout.hidden = picked === null || shown === null;
    this.pointed(picked === null || shown === null ? null : coordinatesAt(shown, picked));
    if (picked === null || shown === null) return;
    const [x, y, z] = picked.point;
    const mm = (v: number): string => (v * 1000).toFixed(1);
    setText(this.readout, say.cursor(lengthText(z, sigmaAt(shown, picked)), mm(x), mm(-y)));
  }

  private choose(tool: Tool | null): void {
    this.tool = tool;
    this.spots = [];
    this.refresh();
  }

  private clear(): void {
    this.measurements.length = 0;
    this.spots = [];
    this.refresh();
  }

  private get lastSection(): Measurement | undefined {
    return this.measurements.filter((m) => m.tool === 'section').at(-1);
  }

  private save(name: string, csv: string): void {
    download(fileName(name, null, 'csv'), new Blob([csv], { type: 'text/csv' }));
  }

  private listen(canvas: HTMLCanvasElement): void {
    let scheduled = false;
    canvas.addEventListener('pointermove', (event) => {
      this.cursor = { x: event.offsetX, y: event.offsetY };
      if (scheduled) return;
      scheduled = true;
      requestAnimationFrame(() => {
        scheduled = false;
        this.readCursor();
      });
    });
    canvas.addEventListener('pointerleave', () => {
      this.cursor = null;
      this.readCursor();
    });
    canvas.addEventListener('pointerdown', (event) => {
      this.pressed = event.isPrimary && event.button === 0 ? { x: event.offsetX, y: event.offsetY } : null;
    });
    canvas.addEventListener('pointerup', (event) => {
      const at = { x: event.offsetX, y: event.offsetY };
      const isClick = this.pressed !== null && Math.hypot(at.x - this.pressed.x, at.y - this.pressed.y) < kStill_px;
      if (isClick && this.tool !== null) this.add(at);
    });
  }

  private add(at: { x: number; y: number }): void {
    const surface = this.view.shown;
    const picked = this.view.pick(at);
    if (this.tool === null || surface === null) return;
    if (picked === null) return setText(this.hint, say.nothingThere);
    this.spots.push({ point: picked.point, sigma: sigmaAt(surface, picked) });
    if (this.spots.length === kSpots[this.tool]) {
      const eye = this.view.navigator.ray(at)?.origin ?? [0, 0, 0];
      this.measurements.push(measure(this.tool, this.spots, surface, eye));
      this.spots = [];
    }
    this.refresh();
  }

  private refresh(): void {
    for (const [tool, b] of this.tools) b.setAttribute('aria-pressed', String(tool === this.tool));
    setText(this.hint, this.tool === null ? '' : say.hints[this.tool]);
    this.list.replaceChildren(
      ...this.measurements.map((m, i) => {
        const remove = button('×', say.remove, () => {
          this.measurements.splice(i, 1);
          this.refresh();
        });
        remove.setAttribute('aria-label', say.remove);
        return make('li', {}, make('span', { className: 'quiet' }, say.tools[m.tool]), make('b', {}, valueText(m)), remove);
      }),
    );
    this.view.overlay.marks = this.marks();
    this.drawPlot();
    this.view.invalidate();
  }

  private marks(): Mark[] {
    const marks = this.measurements.map((m): Mark => {
      const path = m.tool === 'section' ? m.profile.flatMap(([a, b]) => [a.point, b.point]) : [];
      return { points: path.length > 0 ? path : m.spots.map((s) => s.point), text: valueText(m) };
    });
    return this.spots.length === 0 ? marks : [...marks, { points: this.spots.map((s) => s.point), text: '' }];
  }

  private drawPlot(): void {
    const section = this.lastSection;
    this.plot.hidden = section === undefined || section.profile.length === 0;
    if (section === undefined || this.plot.hidden || this.plot.clientWidth === 0) return;
    const heights = section.profile.flatMap(([a, b]) => [a.height * 1000, b.height * 1000]);
    const [least, most] = heights.reduce(([l, m], h) => [Math.min(l, h), Math.max(m, h)], [Infinity, -Infinity]);
    const room = Math.max(0.5, 0.08 * (most - least));
    const points = section.profile.flatMap(
      ([a, b]) => [[a.along * 1000, a.height * 1000], [b.along * 1000, b.height * 1000], [0, NaN]] as const,
    );
    const axes = { x: { from: 0, to: section.value * 1000 }, y: { from: least - room, to: most + room }, unit: 'mm' };
    plot(this.plot, axes, [{ points, colour: '--mark' }]);
  }
}
