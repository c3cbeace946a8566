// SPDX-License-Identifier: Apache-2.0
// From the stripe grid to a surface: each camera ray is met with the light sheet of its boundary. codec/FORMAT.md,
// "From the grid to a surface"; the same steps as codec/grid_points.cpp.
import { kAbsent, kMargin, kStraight, kTurned, type Grid, type GridShape } from './gridDecoder';
import { linesOf, type Calibration } from './gridHead';
import { distorts, sheetAt, undistort } from './lens';
import type { VertexQuality } from './quality';

const kRayStep = 8;
const kSheetSamples = 65;
const kSheetRounds = 4;

export interface GridSurface {
  positions: Float32Array<ArrayBuffer>;
  coordinates: Float32Array<ArrayBuffer>;
  triangles: Uint32Array<ArrayBuffer>;
  quality: VertexQuality | null;
}

/** Of a column, pixels, by its code. */
export const kSigmas = Float32Array.from({ length: 64 }, (_, code) => (code === 0 ? 0 : 1e-4 * 2 ** ((code - 1) / 4)));

export class GridPoints {
  private readonly raysX: (Float32Array | null)[]; // of a line, every kRayStep columns
  private readonly raysY: (Float32Array | null)[];
  private readonly sheets: (Float32Array | null)[]; // of a boundary
  readonly straightRays: boolean;
  readonly straightSheets: boolean;
  readonly samples: number;
  readonly sheetFirst: number;
  readonly sheetStep: number;
  // Of straight sheets: z = numerator / (a x + b y + c).
  readonly numerator: Float64Array;
  readonly a: Float64Array;
  readonly b: Float64Array;
  readonly c: Float64Array;

  constructor(readonly calibration: Calibration) {
    const { camera, projector, rotation, translation, stripes } = calibration;
    const lines = linesOf(calibration);
    const boundaries = stripes - 1;
    this.raysX = new Array<Float32Array | null>(lines).fill(null);
    this.raysY = new Array<Float32Array | null>(lines).fill(null);
    this.sheets = new Array<Float32Array | null>(boundaries).fill(null);
    this.straightRays = !distorts(camera);
    this.straightSheets = !distorts(projector) && projector.skew === 0;
    this.samples = Math.floor((camera.width + kRayStep - 1) / kRayStep) + 1;
    const top = -projector.cy / projector.fy;
    const bottom = (projector.height - 1 - projector.cy) / projector.fy;
    const margin = (bottom - top) / 4;
    this.sheetFirst = top - margin;
    this.sheetStep = (bottom - top + 2 * margin) / (kSheetSamples - 1);
    this.numerator = new Float64Array(boundaries);
    this.a = new Float64Array(boundaries);
    this.b = new Float64Array(boundaries);
    this.c = new Float64Array(boundaries);
    const r = rotation;
    const t = translation;
    for (let s = 0; s < boundaries; ++s) {
      const x = (((s + 1) * projector.width) / stripes - 0.5 - projector.cx) / projector.fx;
      this.numerator[s] = x * t[2]! - t[0]!;
      this.a[s] = r[0]! - x * r[6]!;
      this.b[s] = r[1]! - x * r[7]!;
      this.c[s] = r[2]! - x * r[8]!;
    }
  }

  /** Vertices come by line, then boundary: second places last. Throws where a ray meets no sheet in front of camera and projector. */
  toSurface(grid: Grid): GridSurface {
    const { camera, lineStep } = this.calibration;
    const { vertices, boundaries, lines, pictureLines, stride, columns } = grid;
    const positions = new Float32Array(vertices * 3);
    const coordinates = new Float32Array(vertices * 2);
    const triangles = new Uint32Array(grid.triangles * 3);
    const quality: VertexQuality | null =
      grid.sigmas === null && grid.interpolated === null
        ? null
        : { sigmas: new Float32Array(vertices), interpolated: new Uint8Array(vertices) };
    const step = 2 ** -grid.stepBits;
    const place = new Int32Array(boundaries);
    const x = new Float64Array(boundaries);
    const y = new Float64Array(boundaries);
    const z = new Float64Array(boundaries);
    const slope = new Float64Array(boundaries); // of z by the ray's x
    const column = new Float64Array(boundaries);
    let above = new Int32Array(boundaries + 1);
    let index = new Int32Array(boundaries + 1);
    let next = 0;
    let triangle = 0;
    for (let line = 0; line < lines; ++line) {
      [above, index] = [index, above];
      const at = line * stride + kMargin;
      const pictureLine = line % pictureLines; // of second places too
      const first = next;
      let count = 0;
      for (let b = 0; b < boundaries; ++b) {
        index[b] = next;
        const c = columns[at + b]!;
        if (c === kAbsent) continue;
        place[count] = b;
        column[count++] = c * step;
        ++next;
      }
      if (count > 0) {
        this.rays(pictureLine, column, count, x, y);
        if (this.straightSheets) this.meetStraight(place, count, x, y, z, slope);
        else this.meetCurved(place, count, x, y, z, slope);
        const v = (pictureLine * lineStep + 0.5) / camera.height;
        for (let i = 0; i < count; ++i) {
          const depth = z[i]!;
          const p = (first + i) * 3;
          positions[p] = depth * x[i]!;
          positions[p + 1] = depth * y[i]!;
          positions[p + 2] = depth;
          coordinates[(first + i) * 2] = (column[i]! + 0.5) / camera.width;
          coordinates[(first + i) * 2 + 1] = v;
        }
        if (quality !== null) {
          for (let i = 0; i < count; ++i) {
            const of = at + place[i]!;
            if (grid.sigmas !== null) {
              quality.sigmas[first + i] = (kSigmas[grid.sigmas[of]! & 63]! * Math.abs(slope[i]!)) / camera.fx;
            }
            if (grid.interpolated !== null) quality.interpolated[first + i] = grid.interpolated[of]!;
          }
        }
      }
      if (line > 0) triangle = writeCells(grid, at - stride, above, index, triangles, triangle);
    }
    joinCopies(columns, grid, triangles);
    return { positions, coordinates, triangles, quality };
  }

  /** `line`: of the picture. */
  private rays(line: number, column: Float64Array, count: number, x: Float64Array, y: Float64Array): void {
    const { camera, lineStep } = this.calibration;
    const row = line * lineStep;
    if (this.straightRays) {
      const height = (row - camera.cy) / camera.fy;
      const first = (camera.cx + camera.skew * height) / camera.fx;
      for (let i = 0; i < count; ++i) {
        x[i] = column[i]! / camera.fx - first;
        y[i] = height;
      }
      return;
    }
    if (this.raysX[line] === null && 4 * count < this.samples) {
      for (let i = 0; i < count; ++i) [x[i], y[i]] = undistort(camera, column[i]!, row) ?? [NaN, NaN];
      return;
    }
    const [rx, ry] = this.raysOf(line);
    for (let i = 0; i < count; ++i) {
      const at = column[i]! / kRayStep;
      const s = Math.min(Math.max(Math.trunc(at), 0), this.samples - 2);
      const f = at - s;
      x[i] = rx[s]! + f * (rx[s + 1]! - rx[s]!);
      y[i] = ry[s]! + f * (ry[s + 1]! - ry[s]!);
    }
  }

  /** Of a line of a camera that distorts: x and y every kRayStep columns. */
  private raysOf(line: number): [Float32Array, Float32Array] {
    const [known, knownY] = [this.raysX[line] ?? null, this.raysY[line] ?? null];
    if (known !== null && knownY !== null) return [known, knownY];
    const { camera, lineStep } = this.calibration;
    const [rx, ry] = [new Float32Array(this.samples), new Float32Array(this.samples)];
    for (let s = 0; s < this.samples; ++s) [rx[s], ry[s]] = undistort(camera, s * kRayStep, line * lineStep) ?? [NaN, NaN];
    this.raysX[line] = rx;
    this.raysY[line] = ry;
    return [rx, ry];
  }

  /** The same of all lines: [line][x, y][sample]. */
  allRays(): Float32Array {
    const all = new Float32Array(this.raysX.length * 2 * this.samples);
    this.raysX.forEach((_, line) => this.raysOf(line).forEach((values, i) => all.set(values, (2 * line + i) * this.samples)));
    return all;
  }

  /** Of a projector that distorts: [boundary][sample]. */
  allSheets(): Float32Array {
    const all = new Float32Array(this.sheets.length * kSheetSamples);
    this.sheets.forEach((_, boundary) => all.set(this.sheet(boundary), boundary * kSheetSamples));
    return all;
  }

  private meetStraight(
    place: Int32Array,
    count: number,
    x: Float64Array,
    y: Float64Array,
    z: Float64Array,
    slope: Float64Array,
  ): void {
    const { numerator, a, b, c } = this;
    for (let i = 0; i < count; ++i) {
      const s = place[i]!;
      const denominator = a[s]! * x[i]! + b[s]! * y[i]! + c[s]!;
      const depth = numerator[s]! / denominator;
      if (!(depth > 0 && depth < 1e6)) throw new Error('geometry has a ray that meets no light sheet');
      z[i] = depth;
      slope[i] = (depth * a[s]!) / denominator;
    }
  }

  private meetCurved(
    place: Int32Array,
    count: number,
    x: Float64Array,
    y: Float64Array,
    z: Float64Array,
    slope: Float64Array,
  ): void {
    const r = this.calibration.rotation;
    const t = this.calibration.translation;
    for (let i = 0; i < count; ++i) {
      const samples = this.sheet(place[i]!);
      const dx = r[0]! * x[i]! + r[1]! * y[i]! + r[2]!;
      const dy = r[3]! * x[i]! + r[4]! * y[i]! + r[5]!;
      const dz = r[6]! * x[i]! + r[7]! * y[i]! + r[8]!;
      let height = 0;
      let depth = 0;
      for (let round = 0; round < kSheetRounds; ++round) {
        const at = Math.min(Math.max((height - this.sheetFirst) / this.sheetStep, 0), kSheetSamples - 1.001);
        const s = Math.trunc(at);
        const sheet = samples[s]! + (at - s) * (samples[s + 1]! - samples[s]!);
        const denominator = dx - sheet * dz;
        depth = (sheet * t[2]! - t[0]!) / denominator;
        height = (depth * dy + t[1]!) / (depth * dz + t[2]!);
        slope[i] = (depth * (r[0]! - sheet * r[6]!)) / denominator;
      }
      if (!(depth > 0 && depth < 1e6)) throw new Error('geometry has a ray that meets no light sheet');
      z[i] = depth;
    }
  }

  private sheet(boundary: number): Float32Array {
    const known = this.sheets[boundary];
    if (known !== null && known !== undefined) return known;
    const { projector, stripes } = this.calibration;
    const column = ((boundary + 1) * projector.width) / stripes - 0.5;
    const samples = new Float32Array(kSheetSamples);
    for (let s = 0; s < kSheetSamples; ++s) {
      const height = this.sheetFirst + s * this.sheetStep;
      samples[s] = sheetAt(projector.distortion, (column - projector.cx - projector.skew * height) / projector.fx, height);
    }
    this.sheets[boundary] = samples;
    return samples;
  }
}

/** Triangles on second places that are copies of the first ones there are on those. */
export function joinCopies(columns: Int32Array, { boundaries, lines, pictureLines, stride }: GridShape, triangles: Uint32Array): void {
  if (pictureLines === lines) return;
  const firstOf = new Map<number, number>(); // by how many second places are before the copy
  let first = 0;
  let second = 0;
  for (let line = 0; line < pictureLines; ++line) {
    const at = line * stride + kMargin;
    for (let i = at; i < at + boundaries; ++i) {
      const again = columns[i + pictureLines * stride]!;
      if (again !== kAbsent && again === columns[i]) firstOf.set(second, first);
      if (again !== kAbsent) ++second;
      if (columns[i] !== kAbsent) ++first;
    }
  }
  for (let t = triangles.length - 3; t >= 0 && triangles[t]! >= first; t -= 3) {
    for (let i = t; i < t + 3; ++i) triangles[i] = firstOf.get(triangles[i]! - first) ?? triangles[i]!;
  }
}

const kOrder = [3, 1, 0, 2]; // of the corners that triangles lack

function writeCells(
  grid: Grid,
  cellAt: number,
  above: Int32Array,
  below: Int32Array,
  out: Uint32Array,
  at: number,
): number {
  const { cells } = grid;
  for (let b = 0; b + 1 < grid.boundaries; ++b) {
    const cell = cells[cellAt + b]!;
    if (cell === 0) continue;
    const q0 = above[b]!;
    const q1 = below[b]!;
    const q2 = below[b + 1]!;
    const q3 = above[b + 1]!;
    if (cell === kStraight) {
      out[at] = q0;
      out[at + 1] = q1;
      out[at + 2] = q2;
      out[at + 3] = q2;
      out[at + 4] = q3;
      out[at + 5] = q0;
      at += 6;
    } else if (cell === kTurned) {
      out[at] = q1;
      out[at + 1] = q2;
      out[at + 2] = q3;
      out[at + 3] = q3;
      out[at + 4] = q0;
      out[at + 5] = q1;
      at += 6;
    } else {
      const q = [q0, q1, q2, q3];
      for (const lack of kOrder) {
        if (((cell >> lack) & 1) === 0) continue;
        for (let k = 1; k < 4; ++k) out[at++] = q[(lack + k) & 3]!;
      }
    }
  }
  return at;
}
