// SPDX-License-Identifier: Apache-2.0
// How exactly surfaces show a plane or a sphere that is known to be one, over the last frames: the figures of
// `relievo measure`, by the same rules (client/measure/shape_meter). Measured points alone count. Pure; metres.
import { undistort, type Lens } from './lens';
import type { Surface, Vec3 } from './pick';
import { depthsIn, seenBy, type Region } from './region';
import { fitShape, heightOver, kMadToSigma, medianOf, normalAt, type Shape, type ShapeKind } from './shape';

const kLeastPoints = 50;
const kOffDeviations = 5;
const kSpanShare = 0.997;
const kLeastFull = 1e-6;
const kMostFrames = 30;
const kMostPixels = 4e6; // of all frames that are kept
const kMostOff = 0.2; // of the points: then it is doubtful that they show that shape
const kClearlyOn = 0.15; // and then no more, as frames follow each other

/** Over frames. */
export interface Spread {
  readonly median: number;
  readonly deviation: number; // standard; 0 of one frame
}

export interface ShapeReport {
  readonly frames: number;
  readonly withoutShape: number; // in which too few points lay in the region, or on no one shape
  readonly points: Spread;
  readonly off: Spread; // share of them more than five robust deviations away: they count no further
  readonly rms: Spread; // of the points' heights over the shape of their own frame
  readonly span: Spread; // that .997 of them lie within
  readonly expected: Spread | null; // of rms, by the points' own standard deviations
  readonly size: Spread; // of a plane its depth at the region's middle, of a sphere its radius
  readonly tilt: Spread; // of a plane against the camera's axis; degrees
  readonly centre: readonly Spread[]; // of a sphere
  readonly filled: number; // share of the region's pixels with surface
  readonly form: number; // RMS over pixels of each one's mean height
  readonly noise: number | null; // median over pixels of the standard deviation of their depths over frames
}

interface Figures {
  points: number;
  off: number;
  rms: number;
  span: number;
  expected: number | null;
}

/** A frame, as far as it is kept. */
interface Measured extends Figures {
  readonly shape: Shape;
  readonly size: number;
  readonly filled: number; // pixels
  readonly depths: Float32Array; // of the region's pixels; NaN: none
  readonly heights: Float32Array;
}

const upperMedian = (values: readonly number[]): number => (values.length === 0 ? 0 : medianOf(Float64Array.from(values)));

function spread(values: readonly number[]): Spread {
  const mean = values.reduce((sum, v) => sum + v, 0) / values.length;
  const squares = values.reduce((sum, v) => sum + (v - mean) ** 2, 0);
  return { median: upperMedian(values), deviation: values.length > 1 ? Math.sqrt(squares / (values.length - 1)) : 0 };
}

export class ShapeMeter {
  private readonly rays: Float64Array; // x/z and y/z of the region's pixels; NaN: none
  private readonly room: number; // frames
  private last: (Measured | null)[] = []; // null: the frame shows no such shape

  /** `region` lies in the lens's picture. */
  constructor(
    private readonly lens: Lens,
    readonly region: Region,
    readonly kind: ShapeKind,
  ) {
    const { column, row, width, height } = region;
    this.rays = new Float64Array(2 * width * height);
    for (let i = 0; i < width * height; ++i) {
      this.rays.set(undistort(lens, column + (i % width), row + Math.floor(i / width)) ?? [NaN, NaN], 2 * i);
    }
    this.room = Math.min(kMostFrames, Math.max(2, Math.floor(kMostPixels / (width * height))));
  }

  clear(): void {
    this.last = [];
  }

  /** Instead of the last one, where it `replaces` that. */
  add(surface: Surface, replaces = false): void {
    if (replaces) this.last.pop();
    this.last.push(this.measure(surface));
    if (this.last.length > this.room) this.last.shift();
  }

  private measure(surface: Surface): Measured | null {
    const seen = seenBy(this.lens, surface.positions);
    const { points, sigmas } = this.collect(surface, seen);
    const shape = points.length < 3 * kLeastPoints ? null : fitShape(this.kind, points);
    if (shape === null) return null;
    const { depths, heights, filled } = this.pixelsOf(depthsIn(this.region, seen, surface.triangles), shape);
    return { ...figuresOf(shape, points, sigmas), shape, size: this.sizeOf(shape), filled, depths, heights };
  }

  /** Of the last frame. */
  get shape(): Shape | null {
    return this.last.at(-1)?.shape ?? null;
  }

  private get measured(): Measured[] {
    return this.last.filter((frame) => frame !== null);
  }

  /** Null: no frame has shown the shape. */
  report(): ShapeReport | null {
    const { measured } = this;
    if (measured.length === 0) return null;
    const over = (of: (frame: Measured) => number): Spread => spread(measured.map(of));
    const expected = measured.flatMap((frame) => frame.expected ?? []);
    const tilt = (frame: Measured): number => (Math.acos(Math.min(1, Math.max(-1, -frame.shape.at[2]))) * 180) / Math.PI;
    return {
      frames: measured.length,
      withoutShape: this.last.length - measured.length,
      points: over((frame) => frame.points),
      off: over((frame) => frame.off),
      rms: over((frame) => frame.rms),
      span: over((frame) => frame.span),
      expected: expected.length === 0 ? null : spread(expected),
      size: over((frame) => frame.size),
      tilt: over(tilt),
      centre: ([0, 1, 2] as const).map((axis) => over((frame) => frame.shape.at[axis])),
      filled: measured.reduce((sum, frame) => sum + frame.filled, 0) / (measured.length * this.pixels),
      ...this.formAndNoise(),
    };
  }

  /**
   * Each pixel's mean height: red before a plane or outside a sphere, blue behind or inside, full at `full`; clear where there
   * is no surface. RGBA of the region's size.
   */
  picture(full: number): Uint8ClampedArray<ArrayBuffer> {
    const { measured } = this;
    const out = new Uint8ClampedArray(4 * this.pixels);
    for (let i = 0; i < this.pixels; ++i) {
      const { frames, mean } = meanOf(measured, (frame) => frame.heights[i]!);
      if (frames === 0) continue;
      const share = Math.min(1, Math.max(-1, mean / full));
      const pale = Math.round(255 * (1 - Math.abs(share)));
      out[4 * i] = share < 0 ? pale : 255;
      out[4 * i + 1] = pale;
      out[4 * i + 2] = share > 0 ? pale : 255;
      out[4 * i + 3] = 255;
    }
    return out;
  }

  private get pixels(): number {
    return this.region.width * this.region.height;
  }

  private collect({ positions, quality }: Surface, seen: Float64Array): { points: Float32Array; sigmas: Float32Array } {
    const { column, row, width, height } = this.region;
    const points = new Float32Array(positions.length);
    const sigmas = new Float32Array(positions.length / 3);
    let count = 0;
    for (let v = 0; 3 * v < positions.length; ++v) {
      if (!(positions[3 * v + 2]! > 0) || quality?.interpolated[v] === 1) continue;
      // A pixel's middle is a whole number.
      const [x, y] = [seen[3 * v]! + 0.5, seen[3 * v + 1]! + 0.5];
      if (!(seen[3 * v + 2]! > 0 && x >= column && x < column + width && y >= row && y < row + height)) continue;
      points.set(positions.subarray(3 * v, 3 * v + 3), 3 * count);
      sigmas[count++] = quality?.sigmas[v] ?? 0;
    }
    return { points: points.subarray(0, 3 * count), sigmas: sigmas.subarray(0, count) };
  }

  private sizeOf({ kind, at, size }: Shape): number {
    if (kind === 'sphere') return size;
    const { column, row, width, height } = this.region;
    const ray = undistort(this.lens, column + (width - 1) / 2, row + (height - 1) / 2);
    return ray === null ? NaN : -size / (at[0] * ray[0] + at[1] * ray[1] + at[2]);
  }

  private pixelsOf(z: Float64Array, shape: Shape): Pick<Measured, 'depths' | 'heights' | 'filled'> {
    const depths = new Float32Array(z.length).fill(NaN);
    const heights = new Float32Array(z.length).fill(NaN);
    let filled = 0;
    for (let i = 0; i < z.length; ++i) {
      if (!Number.isFinite(z[i])) continue;
      ++filled;
      const height = heightOver(shape, Math.fround(this.rays[2 * i]! * z[i]!), Math.fround(this.rays[2 * i + 1]! * z[i]!), Math.fround(z[i]!));
      if (!Number.isFinite(height)) continue;
      depths[i] = z[i]!;
      heights[i] = height;
    }
    return { depths, heights, filled };
  }

  // What is off the shape is not of its form. Pixels that most frames show count.
  private formAndNoise(): Pick<ShapeReport, 'form' | 'noise'> {
    const { measured } = this;
    const heights = new Float64Array(this.pixels);
    const deviations = new Float64Array(this.pixels);
    let [formed, moving] = [0, 0];
    for (let i = 0; i < this.pixels; ++i) {
      const { frames, mean } = meanOf(measured, (frame) => frame.heights[i]!);
      if (frames === 0 || frames * 2 < measured.length) continue;
      heights[formed++] = Math.abs(mean);
      if (frames < 2) continue;
      const depth = meanOf(measured, (frame) => frame.depths[i]!).mean;
      let squares = 0;
      for (const { depths } of measured) if (!Number.isNaN(depths[i])) squares += (depths[i]! - depth) ** 2;
      deviations[moving++] = Math.sqrt(squares / (frames - 1));
    }
    if (formed === 0) return { form: 0, noise: null };
    const limit = kOffDeviations * kMadToSigma * medianOf(heights, formed);
    let [on, squares] = [0, 0];
    for (let i = 0; i < formed; ++i) {
      if (heights[i]! > limit) continue;
      ++on;
      squares += heights[i]! ** 2;
    }
    return { form: Math.sqrt(squares / on), noise: moving === 0 ? null : medianOf(deviations, moving) };
  }
}

/** Whether it is doubtful that the points show that shape; `before`: whether it was of the frames before. */
export function isDoubtful({ off, frames }: Pick<ShapeReport, 'off' | 'frames'>, before: boolean): boolean {
  return off.median > (before && frames > 1 ? kClearlyOn : kMostOff);
}

/** At which a picture of such a form is of full colour. */
export const fullOf = ({ form }: ShapeReport): number => Math.max(3 * form, kLeastFull);

function meanOf(measured: readonly Measured[], of: (frame: Measured) => number): { frames: number; mean: number } {
  let [frames, sum] = [0, 0];
  for (const frame of measured) {
    const value = of(frame);
    if (Number.isNaN(value)) continue;
    ++frames;
    sum += value;
  }
  return { frames, mean: sum / frames };
}

function figuresOf(shape: Shape, points: Float32Array, sigmas: Float32Array): Figures {
  const count = sigmas.length;
  const heights = new Float64Array(count);
  for (let i = 0; i < count; ++i) heights[i] = heightOver(shape, points[3 * i]!, points[3 * i + 1]!, points[3 * i + 2]!);
  const limit = kOffDeviations * kMadToSigma * medianOf(heights.map(Math.abs));
  let [on, squares, expected, isKnown] = [0, 0, 0, true];
  for (let i = 0; i < count; ++i) {
    if (Math.abs(heights[i]!) > limit) continue;
    ++on;
    squares += heights[i]! ** 2;
    if (!(sigmas[i]! > 0)) isKnown = false;
    // An error of depth moves the point along its ray.
    const p: Vec3 = [points[3 * i]!, points[3 * i + 1]!, points[3 * i + 2]!];
    const n = normalAt(shape, p);
    expected += (((n[0] * p[0] + n[1] * p[1] + n[2] * p[2]) / p[2]) * sigmas[i]!) ** 2;
  }
  heights.sort();
  const cut = Math.floor(((1 - kSpanShare) / 2) * count);
  return {
    points: count,
    off: 1 - on / count,
    rms: Math.sqrt(squares / on),
    span: heights[count - 1 - cut]! - heights[cut]!,
    expected: isKnown ? Math.sqrt(expected / on) : null,
  };
}

/** As `relievo measure --json` says it. */
export function reportJson(report: ShapeReport, { kind, region }: Pick<ShapeMeter, 'kind' | 'region'>): Record<string, unknown> {
  const of = ({ median, deviation }: Spread, unit = 1): object => ({ median: median * unit, sd: deviation * unit });
  const mm = (of_: Spread): object => of(of_, 1e3);
  return {
    shape: kind,
    region: [region.column, region.row, region.width, region.height],
    frames: report.frames,
    frames_without: report.withoutShape,
    points: of(report.points),
    off: of(report.off),
    filled: report.filled,
    rms_mm: mm(report.rms),
    expected_mm: report.expected === null ? null : mm(report.expected),
    span_mm: mm(report.span),
    form_mm: report.form * 1e3,
    noise_mm: report.noise === null ? null : report.noise * 1e3,
    ...(kind === 'plane' ? { depth_mm: mm(report.size), tilt_deg: of(report.tilt) } : { radius_mm: mm(report.size), centre_mm: report.centre.map(mm) }),
  };
}
