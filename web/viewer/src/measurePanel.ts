// SPDX-License-Identifier: Apache-2.0
// Measuring with the mouse or a finger: which tool, what was measured, and the place under the cursor.
import { button, element, make, setText } from './dom';
import { copy, download, fileName } from './download';
import {
  kSpots,
  kTools,
  markOf,
  measure,
  measurementsCsv,
  sectionCsv,
  valueText,
  type Measurement,
  type Spot,
  type Tool,
} from './measure';
import type { Mark } from './overlay';
import { coordinatesAt, sigmaAt, type Vec3 } from './pick';
import { plot } from './plot';
import type { StreamInfo } from './protocol';
import { inverse, moved } from './rigid';
import { rigErrorOf } from './rigError';
import { text } from './strings';
import type { Hit, View } from './view';

const kStill_px = 5; // a click moves no further
const say = text.measure;

/** What its ± is of. */
const partsText = ({ surface, rig }: Measurement): string =>
  surface === null ? (rig === null ? say.noSigma : say.sigmaOfRig) : rig === null ? say.sigmaOfSurface : say.sigmaOfBoth;

export class MeasurePanel {
  private tool: Tool | null = null;
  private spots: Spot[] = [];
  readonly measurements: Measurement[] = [];
  private cursor: { x: number; y: number } | null = null;
  private pressed: { x: number; y: number } | null = null;
  private readonly tools: Map<Tool, HTMLButtonElement>;
  private readonly hint = make('p', { className: 'quiet' });
  private readonly sigmas = make('p', { className: 'quiet', hidden: true });
  private readonly list = make('ol', { className: 'measurements' });
  private readonly plot = make('canvas', { className: 'plot', hidden: true });
  private readonly readout = element('cursor');

  /** `pointed`: where in the camera's picture the cursor is; `described`: what is known of a stream. */
  constructor(
    body: HTMLElement,
    private readonly view: View,
    private readonly pointed: (at: [number, number] | null) => void,
    private readonly described: (stream: string) => StreamInfo | null,
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
    body.append(group, this.hint, this.list, this.sigmas, this.plot, make('div', { className: 'buttons' }, copied, csv, section, clear));
    this.listen(view.canvas);
    const others = view.overlay.marks; // loaded before or behind this
    view.overlay.marks = () => [...others(), ...this.marks()];
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
    const hit = this.cursor === null ? null : this.view.pick(this.cursor);
    this.readout.hidden = hit === null;
    this.pointed(hit !== null && hit.stream === this.view.name ? coordinatesAt(hit.surface, hit) : null);
    if (hit === null) return;
    const [x, y] = hit.point;
    const mm = (v: number): string => (v * 1000).toFixed(1);
    const read = say.cursor(valueText(measure('point', [this.spot(hit)], null, [0, 0, 0])), mm(x), mm(-y));
    setText(this.readout, this.view.isAlone ? read : say.cursorOf(hit.stream, read));
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
    const hit = this.view.pick(at);
    if (this.tool === null) return;
    if (hit === null) return setText(this.hint, say.nothingThere);
    const { surface, stream, pose } = hit;
    const other = this.spots.some((spot) => spot.stream !== stream);
    const isTrue = [...this.spots.map((spot) => spot.stream), stream].every((name) => this.view.standsTrue(name));
    if (other && (!isTrue || this.tool === 'section')) return setText(this.hint, say.otherStream);
    this.spots.push(this.spot(hit));
    if (this.spots.length === kSpots[this.tool]) {
      const origin = this.view.navigator.ray(at)?.origin;
      const eye: Vec3 = origin === undefined ? [0, 0, 0] : moved(inverse(pose), origin);
      this.measurements.push(measure(this.tool, this.spots, surface, eye));
      this.spots = [];
    }
    this.refresh();
  }

  private spot(hit: Hit): Spot {
    const { point, surface, stream, pose } = hit;
    return { point, sigma: sigmaAt(surface, hit), stream, pose, rig: rigErrorOf(this.described(stream)) };
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
        return make('li', {}, make('span', { className: 'quiet' }, say.tools[m.tool]), make('b', {}, valueText(m)), remove);
      }),
    );
    const { measurements } = this;
    this.sigmas.hidden = measurements.length === 0;
    setText(this.sigmas, [...new Set(measurements.map(partsText))].join(' '));
    this.drawPlot();
    this.view.invalidate();
  }

  private marks(): Mark[] {
    const mark = (of: Pick<Measurement, 'spots' | 'profile'>, text: string): Mark[] => {
      const poses = of.spots.map(({ stream }) => this.view.poseOf(stream)).filter((pose) => pose !== null);
      if (of.spots.length === 0 || poses.length < of.spots.length) return []; // of a stream that is not to be seen
      return [markOf(of, poses, text)];
    };
    return [...this.measurements.flatMap((m) => mark(m, valueText(m))), ...mark({ spots: this.spots, profile: [] }, '')];
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
