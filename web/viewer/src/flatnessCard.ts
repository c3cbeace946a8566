// SPDX-License-Identifier: Apache-2.0
// How exactly a flat wall or a ball is seen, of a rectangle of the rig camera's picture: what is chosen, the figures, and
// where it is off. Part of the measuring panel.
import { button, make, setText } from './dom';
import { copy } from './download';
import { pixelOf, undistort, type Lens } from './lens';
import type { Mark } from './overlay';
import type { Vec3 } from './pick';
import type { StreamInfo } from './protocol';
import { middleRegion, parseRegion, regionBetween, regionText, type Region } from './region';
import { lensOf } from './rigCamera';
import { kShapes, type ShapeKind } from './shape';
import { fullOf, reportJson, ShapeMeter, type ShapeReport, type Spread } from './shapeMeter';
import { text } from './strings';
import type { View } from './view';

const kRest = 2; // times as long as a frame took to measure, the page is left in peace
const kSideSteps = 8; // of an outline: a lens bends it
const kMostOff = 0.2; // of the points: then it is doubtful that they show that shape
const say = text.measure.flatness;
type Name = keyof typeof say.names;
type Place = Readonly<{ x: number; y: number }>;
type Pixel = readonly [column: number, row: number];

export interface FlatnessOf {
  readonly view: View;
  /** What is known of a stream. */
  described(stream: string): StreamInfo | null;
  /** What is shown goes on by itself. */
  playing(): boolean;
  /** Said where hints stand. */
  told(hint: string): void;
}

const mm = (metres: number, digits: number): string => `${(metres * 1000).toFixed(digits)} mm`;
const changing = ({ median, deviation }: Spread, frames: number): string => `${mm(median, 3)}${frames > 1 ? ` (± ${(deviation * 1000).toFixed(3)})` : ''}`;
const percent = (share: number): string => `${(100 * share).toFixed(2)} %`;

export class FlatnessCard {
  readonly box = make('div', { className: 'flatness', hidden: true });
  private kind: ShapeKind = 'plane';
  private chosen: Region | null = null; // null: the middle
  private corner: Pixel | null = null; // the first one, where the other is awaited
  private meter: ShapeMeter | null = null;
  private madeFor = ''; // lens, region and shape of the meter
  private measured: { frame: object; number: number; wasPlaying: boolean } | null = null;
  private report: ShapeReport | null = null;
  private timer = 0;
  private restUntil = 0;
  private readonly shapes: Map<ShapeKind, HTMLButtonElement>;
  private readonly region = make('input', { type: 'text', spellcheck: false, autocomplete: 'off', title: say.regionTitle });
  private readonly warning = make('p', { className: 'warn', hidden: true });
  private readonly figures = make('dl', { className: 'figures' });
  private readonly values = new Map<Name, HTMLElement>();
  private readonly picture = make('canvas');
  private readonly scale = make('figcaption', { className: 'quiet' });
  private readonly pictured = make('figure', {}, this.picture, this.scale);

  constructor(private readonly of: FlatnessOf) {
    this.shapes = new Map(kShapes.map((kind) => [kind, button(say.shapes[kind][0]!, say.shapes[kind][1]!, () => this.setKind(kind))]));
    const group = make('div', { className: 'segments' }, ...this.shapes.values());
    group.setAttribute('role', 'group');
    group.setAttribute('aria-label', say.shape);
    this.region.onchange = () => this.readRegion();
    const region = make('label', { className: 'row' }, make('span', {}, say.region), this.region);
    const middle = button(say.middle, say.middleTitle, () => this.setRegion(null));
    const copied = button(say.copy, say.copyTitle, () => {
      void copy(JSON.stringify(this.json)).then((done) => of.told(done ? text.measure.copied : say.notCopied));
    });
    for (const name of Object.keys(say.names) as Name[]) {
      const [label, title] = say.names[name];
      const value = make('dd', {}, '–');
      this.values.set(name, value);
      this.figures.append(make('dt', { title }, label), value);
    }
    this.picture.setAttribute('role', 'img');
    this.picture.setAttribute('aria-label', say.picture);
    this.warning.setAttribute('role', 'status');
    this.box.append(group, region, this.warning, this.figures, this.pictured, make('div', { className: 'buttons' }, middle, copied));
  }

  set active(active: boolean) {
    this.box.hidden = !active;
    this.corner = null;
    window.clearTimeout(this.timer);
    this.timer = 0;
    this.look();
  }
  get active(): boolean {
    return !this.box.hidden;
  }

  /** As `relievo measure --json` prints it; null: nothing is measured. */
  get json(): Record<string, unknown> | null {
    return this.report === null || this.meter === null ? null : reportJson(this.report, this.meter);
  }

  /** Two of these are opposite corners. */
  click(at: Place): void {
    const { lens } = this;
    if (lens === null) return this.of.told(say.noCamera);
    const pixel = this.pixelAt(at, lens);
    if (typeof pixel === 'string') return this.of.told(pixel);
    if (this.corner === null) {
      this.corner = pixel;
      this.of.told(say.otherCorner);
    } else {
      this.setRegion(regionBetween(this.corner, pixel, lens));
    }
    this.of.view.invalidate();
  }

  /** Measures the frame that is shown, unless it was; later, where the page has done little else of late. */
  look(): void {
    if (!this.active || this.timer !== 0) return;
    const wait = this.restUntil - performance.now();
    if (wait > 0) {
      this.timer = window.setTimeout(() => {
        this.timer = 0;
        this.look();
      }, wait);
      return;
    }
    const start = performance.now();
    if (!this.measure()) return;
    this.show();
    this.restUntil = performance.now() + kRest * (performance.now() - start);
  }

  /** The region, and what is being chosen; `cursor`: where the other corner would be. */
  marks(cursor: Place | null): Mark[] {
    const { lens, meter, corner } = this;
    if (!this.active || lens === null) return [];
    const marks: Mark[] = [];
    if (meter !== null && corner === null) {
      const rms = this.report === null ? '' : say.mark(mm(this.report.rms.median, 4));
      marks.push({ points: this.outline(meter.region, lens), dots: [], text: rms });
    }
    if (corner === null) return marks;
    const pixel = cursor === null ? corner : this.pixelAt(cursor, lens);
    const points = this.outline(regionBetween(corner, typeof pixel === 'string' ? corner : pixel, lens), lens);
    return [...marks, { points, dots: points.slice(0, 1), text: '' }];
  }

  private get lens(): Lens | null {
    const camera = this.of.described(this.of.view.name)?.camera;
    return camera === undefined ? null : lensOf(camera);
  }

  private setKind(kind: ShapeKind): void {
    this.kind = kind;
    this.restUntil = 0;
    this.look();
  }

  private setRegion(region: Region | null): void {
    this.chosen = region;
    this.corner = null;
    this.restUntil = 0;
    this.of.told(text.measure.hints.flatness);
    this.look();
  }

  private readRegion(): void {
    const { lens } = this;
    if (lens === null) return;
    const typed = this.region.value.trim();
    const region = typed === '' ? null : parseRegion(typed, lens);
    const isWrong = typed !== '' && region === null;
    this.region.setAttribute('aria-invalid', String(isWrong));
    if (isWrong) this.of.told(say.wrongRegion(lens.width, lens.height));
    else this.setRegion(region);
  }

  /** The rig camera's pixel at a place of the page, or why there is none. */
  private pixelAt(at: Place, lens: Lens): Pixel | string {
    const { view } = this.of;
    const { picture } = view.navigator;
    if (picture !== null) {
      const scale = picture.width / lens.width;
      return [(at.x - picture.x) / scale - 0.5, (at.y - picture.y) / scale - 0.5];
    }
    const hit = view.pick(at);
    if (hit === null) return text.measure.nothingThere;
    if (hit.stream !== view.name) return say.otherStream;
    const [x, y, z] = hit.point;
    return pixelOf(lens, x / z, y / z);
  }

  /** Whether there is something new to be shown. */
  private measure(): boolean {
    const { view, playing } = this.of;
    const { lens } = this;
    const frame = view.shown;
    if (lens === null || frame === null) {
      this.meter = this.measured = null;
      this.madeFor = '';
      return true;
    }
    const region = this.chosen !== null && parseRegion(regionText(this.chosen), lens) !== null ? this.chosen : middleRegion(lens);
    const madeFor = JSON.stringify([view.name, lens, region, this.kind]);
    if (madeFor !== this.madeFor) {
      this.meter = new ShapeMeter(lens, region, this.kind);
      this.madeFor = madeFor;
      this.measured = null;
    }
    const isPlaying = playing();
    if (frame === this.measured?.frame) {
      this.measured.wasPlaying = isPlaying;
      return false;
    }
    if (frame.quality === null && frame.codedQuality != null) return false; // the next one says which points are measured
    const isSame = frame.number === this.measured?.number;
    // Steps and jumps are no noise. The last frame comes when it plays no more.
    const goesOn = isPlaying || this.measured?.wasPlaying === true;
    if (!isSame && (!goesOn || frame.number < (this.measured?.number ?? 0))) this.meter!.clear();
    this.meter!.add(frame, isSame);
    this.measured = { frame, number: frame.number, wasPlaying: isPlaying };
    return true;
  }

  private show(): void {
    const { meter, kind } = this;
    this.report = meter?.report() ?? null;
    const { report } = this;
    for (const [name, b] of this.shapes) b.setAttribute('aria-pressed', String(name === kind));
    if (document.activeElement !== this.region) {
      this.region.value = meter === null ? '' : regionText(meter.region);
      this.region.setAttribute('aria-invalid', 'false');
    }
    const warning = meter === null ? say.noCamera : report === null ? say.none[kind] + say.why : report.off.median > kMostOff ? say.muchOff[kind] : '';
    setText(this.warning, warning);
    this.warning.hidden = warning === '';
    this.figures.hidden = this.pictured.hidden = report === null;
    if (report !== null) this.showFigures(report);
    if (report !== null) this.drawPicture(report);
    this.of.view.invalidate();
  }

  private showFigures(r: ShapeReport): void {
    const isPlane = this.kind === 'plane';
    const said: Record<Name, string | null> = {
      depth: isPlane ? changing(r.size, r.frames) : null,
      tilt: isPlane ? `${r.tilt.median.toFixed(2)}°` : null,
      radius: isPlane ? null : changing(r.size, r.frames),
      centre: isPlane ? null : `${r.centre.map(({ median }) => (median * 1000).toFixed(2)).join(' ')} mm`,
      points: r.points.median.toFixed(0),
      filled: percent(r.filled),
      error: `RMS ${mm(r.rms.median, 4)}`,
      expected: r.expected === null ? null : `RMS ${mm(r.expected.median, 4)}`,
      span: mm(r.span.median, 4),
      off: percent(r.off.median),
      form: `RMS ${mm(r.form, 4)}`,
      noise: r.noise === null ? null : mm(r.noise, 4),
      frames: `${r.frames}${r.withoutShape > 0 ? `, ${r.withoutShape} left out` : ''}`,
    };
    for (const [name, value] of this.values) {
      const words = said[name];
      setText(value, words ?? '–');
      value.hidden = (value.previousElementSibling as HTMLElement).hidden = words === null && name !== 'expected' && name !== 'noise';
    }
  }

  private drawPicture(report: ShapeReport): void {
    const { region } = this.meter!;
    const full = fullOf(report);
    [this.picture.width, this.picture.height] = [region.width, region.height];
    this.picture.getContext('2d')!.putImageData(new ImageData(this.meter!.picture(full), region.width, region.height), 0, 0);
    setText(this.scale, say.scale(Number((full * 1000).toPrecision(3)).toString()));
  }

  // On the shape, or as far as what is shown.
  private outline({ column, row, width, height }: Region, lens: Lens): Vec3[] {
    const { view } = this.of;
    const pose = view.poseOf(view.name);
    if (pose === null) return [];
    const [right, bottom] = [column + width - 1, row + height - 1];
    const corners: Pixel[] = [[column, row], [right, row], [right, bottom], [column, bottom], [column, row]];
    const points: Vec3[] = [];
    for (let side = 0; side < 4; ++side) {
      const [[c0, r0], [c1, r1]] = [corners[side]!, corners[side + 1]!];
      for (let i = side === 0 ? 0 : 1; i <= kSideSteps; ++i) {
        const ray = undistort(lens, c0 + ((c1 - c0) * i) / kSideSteps, r0 + ((r1 - r0) * i) / kSideSteps);
        if (ray === null) continue;
        const away = this.awayAlong(ray);
        if (away > 0) points.push([ray[0] * away, ray[1] * away, away]);
      }
    }
    return points;
  }

  private awayAlong([x, y]: readonly [number, number]): number {
    const shape = this.meter?.shape ?? null;
    if (shape?.kind === 'plane') return -shape.size / (shape.at[0] * x + shape.at[1] * y + shape.at[2]);
    return shape?.at[2] ?? this.of.view.shown?.extent?.centre[2] ?? 0;
  }
}
