// SPDX-License-Identifier: Apache-2.0
// Measuring with the mouse or a finger: which tool, what was measured, and the place under the cursor.
import { button, element, make, setText, toggle } from './dom';
import { copy, download, fileName } from './download';
import { FlatnessCard } from './flatnessCard';
import { Fold } from './fold';
import {
  alongRay,
  kSpots,
  kTools,
  markOf,
  measure,
  measurementsCsv,
  section,
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
import type { Measured } from './share';
import { readFlatRegion, readMeasurement, writeFlatRegion, writeMeasurement } from './shareMeasure';
import { Snapper, type Caught } from './snapper';
import { text } from './strings';
import type { Hit } from './surfaces';
import type { View } from './view';

const kStill_px = 5; // a click moves no further
const kSlack_px = 10; // from an edge or corner that is meant
const kFinger_px = 20;
const kBeside_px = 24; // of the place that is read: what is read of it keeps as far away (style.css)
const kHint_ms = 120; // between two looks for what a click would be on, at least
const kRest = 4; // times that long it is left in peace after one
const kStored = 'relievo.snap';
const say = text.measure;

/** A place of the page, and how exactly it is pointed at. */
interface Pointed {
  readonly x: number;
  readonly y: number;
  readonly slack: number; // 0: exactly there
}

const pointedBy = (event: PointerEvent): Pointed => ({
  x: event.offsetX,
  y: event.offsetY,
  slack: event.altKey ? 0 : event.pointerType === 'touch' ? kFinger_px : kSlack_px,
});

/** What its ± is of. */
const partsText = ({ surface, rig }: Measurement): string =>
  surface === null ? (rig === null ? say.noSigma : say.sigmaOfRig) : rig === null ? say.sigmaOfSurface : say.sigmaOfBoth;

type AnyTool = Tool | 'flatness'; // the latter is of an area of the picture, not of places

export class MeasurePanel {
  private tool: AnyTool | null = null;
  private lastTool: AnyTool = 'distance'; // while the panel was open
  private spots: Spot[] = [];
  readonly measurements: Measurement[] = [];
  private given: readonly Measurement[] = []; // sections of a link
  private uncut: readonly Measurement[] = []; // those whose surface has not come yet
  private cursor: Pointed | null = null;
  private pressed: { x: number; y: number } | null = null;
  private caught: Caught | null = null; // what a click would be on
  private caughtAt = 0;
  private caughtIn = 0; // ms that looking for it took
  private catching = 0; // a timer
  private aiming = false; // by keys, in the middle
  private snaps = loadSnaps();
  private readonly snapper: Snapper;
  private readonly tools: Map<AnyTool, HTMLButtonElement>;
  private readonly flatness: FlatnessCard;
  private readonly places: HTMLElement; // what the other tools need
  private readonly hint = make('p', { className: 'quiet hint' });
  private readonly fold: Fold;
  private choosing = false; // places, of which there is one
  private readonly summary = make('p', { className: 'summary' }); // of what is folded
  private readonly sigmas = make('p', { className: 'quiet', hidden: true });
  private readonly list = make('ol', { className: 'measurements' });
  private readonly plot = make('canvas', { className: 'plot', hidden: true });
  private readonly readout = element('cursor');
  private readonly clearing = button(say.clear, say.clear, () => this.clear());

  /** `pointed`: where in the camera's picture the cursor is; `described`: what is known of a stream; `run`: of the frame that is shown (Session). */
  constructor(
    body: HTMLElement,
    private readonly view: View,
    private readonly pointed: (at: [number, number] | null) => void,
    private readonly described: (stream: string) => StreamInfo | null,
    run: () => string,
  ) {
    const names: AnyTool[] = [...kTools, 'flatness'];
    this.tools = new Map(names.map((tool) => [tool, button(say.tools[tool], say.hints[tool], () => this.choose(tool))]));
    this.flatness = new FlatnessCard({ view, described, run, told: (hint) => setText(this.hint, hint), changed: () => this.sum() });
    this.snapper = new Snapper(view, described);
    const snapping = toggle(say.snap, (on) => this.setSnaps(on));
    snapping.row.title = say.snapTitle;
    snapping.set(this.snaps);
    this.hint.setAttribute('role', 'status');
    const group = make('div', { className: 'segments' }, ...this.tools.values());
    group.setAttribute('role', 'group');
    this.plot.setAttribute('role', 'img');
    this.plot.setAttribute('aria-label', say.plot);
    this.list.setAttribute('aria-live', 'polite');
    const copied = button(say.copy, say.copyTitle, () => {
      void copy(measurementsCsv(this.measurements, '\t')).then((done) => setText(this.hint, done ? say.copied : say.notCopied));
    });
    const csv = button(say.csv, say.csvTitle, () => this.save('measurements', measurementsCsv(this.measurements)));
    const section = button(say.sectionCsv, say.sectionCsvTitle, () => this.save('section', sectionCsv(this.lastSection?.profile ?? [])));
    const buttons = make('div', { className: 'buttons' }, copied, csv, section, this.clearing);
    this.places = make('div', {}, snapping.row, this.list, buttons, this.plot, this.sigmas); // what is read once, last
    this.fold = new Fold(body.parentElement!);
    body.append(group, this.hint, this.summary, this.flatness.box, this.places);
    this.listen(view.canvas);
    const others = view.overlay.marks; // loaded before or behind this
    view.overlay.marks = () => [...others(), ...this.marks()];
    this.refresh();
  }

  /** The panel is open or closed: measurements stay, clicks only count while it is open. */
  set open(open: boolean) {
    this.choose(open ? this.lastTool : null);
    this.drawPlot();
  }
  get isOpen(): boolean {
    return this.tool !== null;
  }

  /** Of the rectangle, as `relievo measure --json` prints it; null: nothing is measured there. */
  get flat(): Record<string, unknown> | null {
    return this.flatness.active ? this.flatness.json : null;
  }

  /** What a link carries to these streams: what was measured on them, and Flatness' region where that was used last. */
  shared(streams: readonly string[]): Measured {
    const measurements = this.measurements.map((m) => writeMeasurement(m, streams)).filter((written) => written !== null);
    return { measurements, flatness: this.lastTool === 'flatness' ? writeFlatRegion(this.flatness.setting) : null };
  }

  /** Shows that in place of what was measured before; what of it makes no sense is left out. */
  restore({ measurements, flatness }: Measured, streams: readonly string[]): void {
    this.clear();
    this.measurements.push(...measurements.map((written) => readMeasurement(written, streams)).filter((m) => m !== null));
    this.given = this.uncut = this.measurements.filter(({ tool }) => tool === 'section');
    const flat = flatness === null ? null : readFlatRegion(flatness);
    if (flat !== null) this.flatness.setting = flat;
    this.lastTool = flat !== null ? 'flatness' : this.lastTool === 'flatness' ? 'distance' : this.lastTool;
    if (this.tool !== null) this.choose(this.lastTool);
    this.refresh();
    this.cut();
    this.fold.fold(); // the picture first, which a panel lies over on a phone
  }

  /** Another surface than so far is that which a link was made of. */
  cutAnew(): void {
    this.uncut = this.given;
  }

  private cut(): void {
    const before = this.uncut.length;
    this.uncut = this.uncut.filter((m) => {
      const [from, to] = m.spots.map(({ point }) => point) as [Vec3, Vec3];
      const { stream } = m.spots[0]!;
      const seen = this.view.seen.find((s) => s.stream === stream);
      if (seen === undefined) return true;
      m.profile = section(seen.surface, from, to, m.eye!, rigErrorOf(this.described(stream)));
      return false;
    });
    if (this.uncut.length < before) this.refresh();
  }

  /** After each drawing of a new surface, and when the cursor moves. */
  readCursor(): void {
    if (this.uncut.length > 0) this.cut();
    this.flatness.look();
    const hit = this.cursor === null ? null : this.view.pick(this.cursor);
    this.pointed(hit !== null && hit.stream === this.view.name ? coordinatesAt(hit.surface, hit) : null);
    this.lookForEdges();
    this.read(hit);
  }

  // `hit`: at the cursor, where that is not on an edge or corner.
  private read(hit: Hit | null): void {
    const spot = this.caught !== null ? this.caughtSpot(this.caught) : hit !== null ? this.spot(hit) : null;
    this.readout.hidden = spot === null;
    if (spot === null) return;
    const [x, y] = spot.point;
    const mm = (v: number): string => (v * 1000).toFixed(1);
    const read = say.cursor(say.kinds[spot.kind], valueText(measure('point', [spot], null, [0, 0, 0])), mm(x), mm(-y));
    setText(this.readout, this.view.isAlone ? read : say.cursorOf(spot.stream, read));
    this.readout.classList.toggle('raised', this.cursor !== null && this.liesUnderReadout(this.cursor));
  }

  // Where it stands unless it was raised.
  private liesUnderReadout({ x, y }: Pointed): boolean {
    const { offsetLeft, offsetTop, offsetWidth, offsetHeight, offsetParent } = this.readout;
    if (offsetParent === null) return false; // nothing but the picture is shown
    const [picture, footer] = [this.view.canvas.getBoundingClientRect(), offsetParent.getBoundingClientRect()];
    const [right, down] = [picture.left + x - footer.left - offsetLeft, picture.top + y - footer.top - offsetTop];
    return right > -kBeside_px && right < offsetWidth + kBeside_px && down > -kBeside_px && down < offsetHeight + kBeside_px;
  }

  // Takes some milliseconds: not with each movement, but with the last one.
  private lookForEdges(): void {
    const isOfPlaces = this.tool !== null && this.tool !== 'flatness';
    if (!isOfPlaces || this.cursor === null || this.cursor.slack === 0 || !this.snaps) return this.hold(null);
    if (this.catching !== 0) return;
    const wait = Math.max(0, this.caughtAt + Math.max(kHint_ms, kRest * this.caughtIn) - performance.now());
    this.catching = window.setTimeout(() => {
      this.catching = 0;
      const start = performance.now();
      this.hold(this.cursor === null || this.tool === null || this.tool === 'flatness' ? null : this.catchAt(this.cursor));
      this.caughtAt = performance.now();
      this.caughtIn = this.caughtAt - start;
      this.read(this.cursor === null ? null : this.view.pick(this.cursor)); // no frame may come behind it
    }, wait);
  }

  private hold(caught: Caught | null): void {
    if (caught === null && this.caught === null) return;
    this.caught = caught;
    this.view.invalidate();
  }

  private catchAt(at: Pointed): Caught | null {
    return this.snaps && at.slack > 0 ? this.snapper.at(at, at.slack, this.view.pick(at)) : null;
  }

  private setSnaps(on: boolean): void {
    this.snaps = on;
    try {
      localStorage.setItem(kStored, on ? '1' : '0');
    } catch {
      // it lasts as long as the page
    }
    this.readCursor();
  }

  private choose(tool: AnyTool | null): void {
    this.tool = tool;
    this.lastTool = tool ?? this.lastTool;
    this.spots = [];
    this.refresh();
    this.flatness.active = tool === 'flatness';
    this.places.hidden = tool === 'flatness';
    this.sum();
  }

  private clear(): void {
    this.measurements.length = 0;
    this.given = this.uncut = [];
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
      this.cursor = pointedBy(event);
      this.aim(false);
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
      const at = pointedBy(event);
      const isClick = this.pressed !== null && Math.hypot(at.x - this.pressed.x, at.y - this.pressed.y) < kStill_px;
      if (isClick && this.tool !== null) this.add(at);
    });
    // The same by keys, in the middle of the view, which arrows turn and move.
    canvas.addEventListener('keydown', (event) => {
      if (this.tool === null || event.key === 'Escape') return;
      if (event.key !== 'Enter') return this.aim(event.key.startsWith('Arrow') || this.aiming);
      event.preventDefault();
      if (this.aiming) this.add({ ...this.view.navigator.middle, slack: event.altKey ? 0 : kSlack_px });
      this.aim(true);
    });
    canvas.addEventListener('blur', () => this.aim(false));
  }

  private aim(aiming: boolean): void {
    if (aiming) this.cursor = { ...this.view.navigator.middle, slack: kSlack_px };
    if (!aiming && !this.aiming) return;
    this.aiming = aiming;
    this.readCursor();
    this.view.invalidate();
  }

  private add(at: Pointed): void {
    if (this.tool === null) return;
    if (this.tool === 'flatness') return this.flatness.click(at);
    const caught = this.catchAt(at);
    const hit = caught === null ? this.view.pick(at) : null;
    const on = caught ?? hit;
    if (on === null) return setText(this.hint, say.nothingThere);
    const { surface, stream, pose } = on;
    const other = this.spots.some((spot) => spot.stream !== stream);
    const isTrue = [...this.spots.map((spot) => spot.stream), stream].every((name) => this.view.standsTrue(name));
    if (other && (!isTrue || this.tool === 'section')) return setText(this.hint, say.otherStream);
    this.spots.push(caught !== null ? this.caughtSpot(caught) : this.spot(hit!));
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
    const sigma = sigmaAt(surface, hit);
    const errors = sigma === null ? null : alongRay(point, sigma);
    return { point, kind: 'surface', errors, stream, pose, rig: rigErrorOf(this.described(stream)) };
  }

  private caughtSpot({ snapped, stream, pose }: Caught): Spot {
    const { point, kind, errors } = snapped;
    return { point, kind, errors, stream, pose, rig: rigErrorOf(this.described(stream)) };
  }

  private refresh(): void {
    for (const [tool, b] of this.tools) b.setAttribute('aria-pressed', String(tool === this.tool));
    setText(this.hint, this.tool === null ? '' : say.hints[this.tool]);
    this.list.replaceChildren(
      ...this.measurements.map((m, i) => {
        const remove = button('×', say.remove, () => {
          this.measurements.splice(i, 1);
          this.refresh();
          // The button that had the focus is gone: the next one has it, or what is behind the last.
          const others = this.list.querySelectorAll('button');
          (others[Math.min(i, others.length - 1)] ?? this.clearing).focus();
        });
        const on = say.spots(m.spots.map(({ kind }) => kind));
        const what = make('span', { className: 'quiet' }, say.tools[m.tool], ...(on === '' ? [] : [make('small', {}, on)]));
        return make('li', {}, what, make('b', {}, valueText(m)), remove);
      }),
    );
    const { measurements } = this;
    this.sigmas.hidden = measurements.length === 0;
    setText(this.sigmas, [...new Set(measurements.map(partsText))].join(' '));
    this.drawPlot();
    this.sum();
    this.view.invalidate();
  }

  private sum(): void {
    const last = this.measurements.at(-1);
    const said = last === undefined ? '' : `${say.tools[last.tool]} ${valueText(last)}`;
    setText(this.summary, this.tool === 'flatness' ? this.flatness.summary : said);
    const isChoosing = this.tool === 'flatness' ? this.flatness.awaitsCorner : this.spots.length > 0;
    if (isChoosing && !this.choosing) this.fold.fold();
    this.choosing = isChoosing;
  }

  private marks(): Mark[] {
    const mark = (of: Pick<Measurement, 'spots' | 'profile'>, text: string): Mark[] => {
      const poses = of.spots.map(({ stream }) => this.view.poseOf(stream)).filter((pose) => pose !== null);
      if (of.spots.length === 0 || poses.length < of.spots.length) return []; // of a stream that is not to be seen
      return [markOf(of, poses, text)];
    };
    const { caught } = this;
    const pose = caught && this.view.poseOf(caught.stream);
    const hint: Mark[] = [];
    if (caught !== null && pose !== null && this.tool !== null) {
      const { kind, point, line } = caught.snapped;
      hint.push({ points: (line ?? [point]).map((p) => moved(pose, p)), dots: [], ring: moved(pose, point), text: say.kinds[kind] });
    }
    return [...this.measurements.flatMap((m) => mark(m, valueText(m))), ...mark({ spots: this.spots, profile: [] }, ''), ...this.flatness.marks(this.cursor), ...hint];
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

/** Unless a person has said otherwise before; the browser may forbid a store. */
function loadSnaps(): boolean {
  try {
    return localStorage.getItem(kStored) !== '0';
  } catch {
    return true;
  }
}
