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
import { kShapes, type Shape, type ShapeKind } from './shape';
import type { Metered, ShapeReply, ShapeRequest } from './shapeMessages';
import type { FlatRegion } from './shareMeasure';
import { isDoubtful, reportJson, type ShapeReport, type Spread } from './shapeMeter';
import { sentence } from './sentence';
import { text } from './strings';
import type { View } from './view';
import { startMeasurer } from './workers';

const kRest = 1; // times as long as a frame took to measure, the machine is left in peace
const kAgain_ms = 2000; // where what measures did not come
const kSideSteps = 8; // of an outline: a lens bends it
const say = text.measure.flatness;
type Name = keyof typeof say.names;
type Place = Readonly<{ x: number; y: number }>;
type Pixel = readonly [column: number, row: number];

export interface FlatnessOf {
  readonly view: View;
  /** What is known of a stream. */
  described(stream: string): StreamInfo | null;
  /** Of the frame that is shown: those of one came one after the other. */
  run(): string;
  /** Said where hints stand. */
  told(hint: string): void;
  /** What is said in short is another, or a corner was chosen. */
  changed(): void;
}

/** A frame that is to be measured. */
interface Asked {
  readonly frame: object;
  readonly number: number;
  readonly run: string;
  readonly meter: Metered;
  readonly key: string; // the stream and the meter
}

interface Measured {
  readonly meter: Metered;
  readonly report: ShapeReport | null;
  readonly shape: Shape | null; // of the last frame
}

const mm = (metres: number, digits: number): string => `${(metres * 1000).toFixed(digits)} mm`;
const changing = ({ median, deviation }: Spread, frames: number): string => `${mm(median, 3)}${frames > 1 ? ` (± ${(deviation * 1000).toFixed(3)})` : ''}`;
const percent = (share: number): string => `${(100 * share).toFixed(2)} %`;

export class FlatnessCard {
  readonly box = make('div', { className: 'flatness', hidden: true });
  private kind: ShapeKind = 'plane';
  private chosen: Region | null = null; // null: the middle
  private corner: Pixel | null = null; // the first one, where the other is awaited
  private worker: Worker | null = null;
  private underWay: Asked | null = null; // with the worker
  private asked: Asked | null = null; // last
  private measured: Measured | null = null; // and shown
  private doubtful = false; // that it shows that shape
  private trouble = ''; // why nothing is measured
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
    this.timer = this.restUntil = 0;
    if (!active) this.forget();
    this.look();
  }
  get active(): boolean {
    return !this.box.hidden;
  }

  /** What is to be measured. */
  get setting(): FlatRegion {
    return { kind: this.kind, region: this.chosen };
  }
  set setting({ kind, region }: FlatRegion) {
    this.kind = kind;
    this.setRegion(region);
    this.press();
  }

  /** As `relievo measure --json` prints it; null: nothing is measured. */
  get json(): Record<string, unknown> | null {
    const report = this.measured?.report ?? null;
    return report === null ? null : reportJson(report, this.measured!.meter);
  }

  /** In a line; empty: nothing is known. */
  get summary(): string {
    const { measured } = this;
    const report = measured?.report ?? null;
    if (report === null) return this.warning.textContent;
    const [label] = measured!.meter.kind === 'plane' ? say.names.depth : say.names.radius;
    return say.summary(`${label} ${mm(report.size.median, 3)}`, mm(report.rms.median, 4));
  }

  /** The other corner is awaited. */
  get awaitsCorner(): boolean {
    return this.corner !== null;
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
    this.of.changed();
    this.of.view.invalidate();
  }

  /** Has the frame that is shown measured, unless it was; later, where much was measured of late. */
  look(): void {
    if (!this.active || this.timer !== 0 || this.underWay !== null) return;
    const wait = this.restUntil - performance.now();
    if (wait > 0) return this.lookIn(wait);
    const asked = this.wanted();
    if (asked === 'nothing') return;
    if (asked === null) {
      this.forget();
      this.measured = null;
      this.show();
    } else {
      this.ask(asked);
    }
  }

  /** The region, and what is being chosen; `cursor`: where the other corner would be. */
  marks(cursor: Place | null): Mark[] {
    const { lens, measured, corner } = this;
    if (!this.active || lens === null) return [];
    const marks: Mark[] = [];
    if (measured !== null && corner === null) {
      const rms = measured.report === null ? '' : say.mark(mm(measured.report.rms.median, 4));
      marks.push({ points: this.outline(measured.meter.region, lens), dots: [], text: rms });
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
    this.press();
    this.lookNow();
  }

  private setRegion(region: Region | null): void {
    this.chosen = region;
    this.corner = null;
    this.of.told(text.measure.hints.flatness);
    this.lookNow();
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

  private lookIn(wait_ms: number): void {
    this.timer = window.setTimeout(() => {
      this.timer = 0;
      this.look();
    }, wait_ms);
  }

  // A person waits for it.
  private lookNow(): void {
    window.clearTimeout(this.timer);
    this.timer = this.restUntil = 0;
    this.look();
  }

  /** Null: nothing can be measured. */
  private wanted(): Asked | null | 'nothing' {
    const { view } = this.of;
    const { lens, kind, asked } = this;
    const frame = view.shown;
    if (lens === null || frame === null) return null;
    if (frame.quality === null && frame.codedQuality != null) return 'nothing'; // the next one says which points are measured
    const region = this.chosen !== null && parseRegion(regionText(this.chosen), lens) !== null ? this.chosen : middleRegion(lens);
    const meter = { lens, region, kind };
    const key = JSON.stringify([view.name, meter]);
    return frame === asked?.frame && key === asked.key ? 'nothing' : { frame, number: frame.number, run: this.of.run(), meter, key };
  }

  private ask(asked: Asked): void {
    const { positions, triangles, quality } = this.of.view.shown!;
    const before = this.asked?.key === asked.key ? this.asked : null;
    const isSame = asked.number === before?.number;
    // Steps and jumps are no noise, nor is what begins anew.
    const goesOn = before !== null && asked.run === before.run && asked.number > before.number;
    // Of its own: the page's memory of a frame is used again.
    const surface = { positions: positions.slice(), coordinates: null, triangles: triangles.slice(), quality: quality && { sigmas: quality.sigmas.slice(), interpolated: quality.interpolated.slice() } };
    const request: ShapeRequest = { meter: before === null ? asked.meter : null, joins: isSame ? 'butTheLast' : goesOn ? 'frames' : 'none', surface };
    this.underWay = this.asked = asked;
    this.box.classList.toggle('awaited', this.measured !== null && before === null);
    this.worker ??= this.start();
    const arrays = [surface.positions, surface.triangles, ...(surface.quality === null ? [] : [surface.quality.sigmas, surface.quality.interpolated])];
    this.worker.postMessage(request, arrays.map(({ buffer }) => buffer));
  }

  private start(): Worker {
    const worker = startMeasurer();
    worker.onmessage = ({ data }: MessageEvent<ShapeReply>) => {
      if (worker === this.worker) this.hear(data); // else it was ended as it answered
    };
    worker.onerror = (event) => {
      event.preventDefault();
      if (worker !== this.worker) return;
      this.forget();
      this.fail(text.panelFailed);
      this.restUntil = performance.now() + kAgain_ms;
      this.look();
    };
    return worker;
  }

  private hear(reply: ShapeReply): void {
    const { meter, key } = this.underWay!;
    this.underWay = null;
    const next = this.wanted();
    const isOfNow = next !== null && (next === 'nothing' || next.key === key);
    if (reply.type === 'failed') {
      this.fail(sentence(reply.message));
    } else if (isOfNow) {
      this.trouble = '';
      this.measured = { meter, report: reply.report, shape: reply.shape };
      this.show();
      if (reply.picture !== null) this.drawPicture(reply.picture, reply.full_m);
    } else {
      reply.picture?.close();
    }
    this.restUntil = isOfNow && reply.type === 'measured' ? performance.now() + kRest * reply.took_ms : 0;
    this.look();
  }

  private fail(why: string): void {
    if (why === this.trouble && this.measured === null) return; // the picture need not be drawn again for it
    this.trouble = why;
    this.measured = null;
    this.show();
  }

  // What it has measured is of no use any more.
  private forget(): void {
    this.worker?.terminate();
    this.worker = this.underWay = this.asked = null;
  }

  private press(): void {
    for (const [name, b] of this.shapes) b.setAttribute('aria-pressed', String(name === this.kind));
  }

  private show(): void {
    const { measured, kind } = this;
    const report = measured?.report ?? null;
    this.doubtful = report !== null && isDoubtful(report, this.doubtful);
    this.press();
    this.box.classList.remove('awaited');
    if (document.activeElement !== this.region) {
      this.region.value = measured === null ? '' : regionText(measured.meter.region);
      this.region.setAttribute('aria-invalid', 'false');
    }
    const warning = this.trouble !== '' ? this.trouble : measured === null ? say.noCamera : report === null ? say.none[kind] + say.why : this.doubtful ? say.muchOff[kind] : '';
    setText(this.warning, warning);
    this.warning.hidden = warning === '';
    this.figures.hidden = this.pictured.hidden = report === null;
    if (report !== null) this.showFigures(report);
    this.of.changed();
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

  private drawPicture(picture: ImageBitmap, full_m: number): void {
    [this.picture.width, this.picture.height] = [picture.width, picture.height];
    this.picture.getContext('bitmaprenderer')!.transferFromImageBitmap(picture);
    setText(this.scale, say.scale(Number((full_m * 1000).toPrecision(3)).toString()));
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
    const shape = this.measured?.shape ?? null;
    if (shape?.kind === 'plane') return -shape.size / (shape.at[0] * x + shape.at[1] * y + shape.at[2]);
    return shape?.at[2] ?? this.of.view.shown?.extent?.centre[2] ?? 0;
  }
}
