// SPDX-License-Identifier: Apache-2.0
// The stripe grid decoded in WebAssembly, where the browser has its vectors of 128 bits: the same results as gridDecoder.ts
// and gridPoints.ts in a third of the time. wasm/grid.h says what it is handed; here is where things lie in its memory.
import {
  checkHalves,
  chooseDiagonals,
  damaged,
  dropCells,
  emptyGrid,
  kAbsent,
  placesOf,
  shapeOf,
  type CodedGrid,
  type Grid,
  type GridShape,
  type KeyGrid,
} from './gridDecoder';
import type { GridFields, GridHead } from './gridHead';
import { joinCopies, kSigmas, type GridPoints, type GridSurface } from './gridPoints';
import { kScale, type Table } from './rans';
import type { Spares } from './spares';

const kPage = 65_536;
const kFirstFree = kPage; // the module's own is below
const kMostBytes = 2 ** 27;
const kTogether = 16; // lines from surface_lines() at a time: they stay in the processor's cache until they are copied
const kMostRays = 4; // samples of a distorting camera's rays for each vertex that are worth working out

interface Exports {
  job_at(): number;
  points_at(): number;
  decode_slice(): number;
  surface_lines(begin: number, end: number): number;
}

// Places of fields in the structs of wasm/grid.h, in words.
const kVerticesAt = 30;
const kNextAt = 21;
const kWrittenAt = 34;

/** Where in the memory of the module, in bytes; what lies there is as long as its name in Places says. */
type Places = Record<keyof ReturnType<typeof sizesOf>, number>;

function sizesOf(grid: GridShape) {
  const places = placesOf(grid) + 16;
  const line = grid.stride + 16;
  const vertices = kTogether * grid.boundaries + 4;
  return {
    columns: 4 * places,
    key: 4 * places,
    cells: places,
    sigmas: places,
    marks: places,
    first: 128,
    tables: 4 * kScale * 21,
    lines: 16 * line, // ten of bytes
    numbers: 4 * 8 * line, // absent, two indices, column, x, y, z, slope
    sheets: 4 * 4 * line, // numerator, a, b, c
    curved: 4 * 65 * grid.boundaries,
    small: 4 * (9 + 3 + 64),
    positions: 12 * vertices,
    coordinates: 8 * vertices,
    depthSigmas: 4 * vertices,
    depthMarks: vertices,
    triangles: 24 * vertices + 64,
    rays: 0, // at the end: as long as a distorting camera needs
  };
}

export class GridKernel {
  private readonly job: number;
  private readonly points: number;
  private at!: Places;
  private end = kFirstFree; // of what is laid out; a frame's bytes lie behind
  private shape = '';
  private keyHere: KeyGrid | null = null;
  private pointsHere: GridPoints | null = null;
  private decoded: { head: GridHead; grid: GridShape } | null = null;
  private bytes = new Uint8Array(0);
  private ints = new Int32Array(0);
  private unsigned = new Uint32Array(0);
  private floats = new Float32Array(0);

  private constructor(
    private readonly memory: WebAssembly.Memory,
    private readonly exports: Exports,
  ) {
    [this.job, this.points] = [exports.job_at(), exports.points_at()];
  }

  /** Fails where the browser has no vectors in WebAssembly. */
  static async create(wasm: BufferSource): Promise<GridKernel> {
    const memory = new WebAssembly.Memory({ initial: 2, maximum: (2 * kMostBytes) / kPage });
    const { instance } = await WebAssembly.instantiate(wasm, { env: { memory } });
    return new GridKernel(memory, instance.exports as unknown as Exports);
  }

  /** Whether grids of that size are for it. */
  takes({ lines, boundaries }: GridFields): boolean {
    return lines * (boundaries + 24) * 16 < kMostBytes;
  }

  /** As decodeSlices(); the grid lies here until the next is decoded. Throws. Any input. */
  decode(coded: CodedGrid): void {
    const { head, tables } = coded;
    const grid = shapeOf(head);
    this.decoded = { head, grid };
    this.layOut(grid);
    this.reserve(Math.max(...coded.slices.map((s) => (s === null ? 0 : s.bytes))));
    const { at, bytes, ints } = this;
    const places = placesOf(grid);
    ints.fill(kAbsent, at.columns >> 2, (at.columns >> 2) + places);
    bytes.fill(0, at.cells, at.cells + places);
    if (head.hasSigmas) bytes.fill(0, at.sigmas, at.sigmas + places);
    if (head.hasInterpolated) bytes.fill(0, at.marks, at.marks + places);
    if (coded.key !== null && this.keyHere !== coded.key) ints.set(coded.key.grid.columns, at.key >> 2);
    if (coded.key !== null) this.keyHere = coded.key;
    new Uint16Array(bytes.buffer, at.first, tables.first.length).set(tables.first);
    [...tables.cells, ...tables.residuals, ...tables.sigmas].forEach((table, i) => this.putTable(table, i));
    coded.slices.forEach((slice, s) => {
      const begin = s * head.sliceLines;
      if (slice === null) {
        // Triangles on vertices that are lost.
        if (s > 0) grid.triangles -= dropCells(bytes.subarray(at.cells, at.cells + places), grid, begin - 1);
        return;
      }
      let next = this.end;
      const streams = [slice.control, slice.residuals, slice.sigmas, slice.raw].flatMap((stream) => {
        bytes.set(stream, next);
        next += stream.length;
        return [next - stream.length, next];
      });
      this.startJob(coded, grid, begin, Math.min(begin + head.sliceLines, head.lines), streams);
      const done = this.exports.decode_slice() !== 0;
      const [vertices, triangles] = [ints[(this.job >> 2) + kVerticesAt]!, ints[(this.job >> 2) + kVerticesAt + 1]!];
      if (!done || vertices !== slice.vertices || triangles !== slice.triangles) throw damaged();
      grid.vertices += vertices;
      grid.triangles += triangles;
    });
    checkHalves(bytes.subarray(at.cells, at.cells + places), grid);
  }

  /** What was decoded, for those that build on it. */
  copyKey(): KeyGrid['grid'] {
    const { grid } = this.decoded!;
    const from = this.at.columns >> 2;
    return { ...grid, columns: this.ints.slice(from, from + placesOf(grid)) };
  }

  /** What was decoded. */
  copy(): Grid {
    const { head, grid } = this.decoded!;
    const { at, bytes } = this;
    const copy = { ...emptyGrid(head), ...this.copyKey(), vertices: grid.vertices, triangles: grid.triangles };
    const places = placesOf(grid);
    copy.cells.set(bytes.subarray(at.cells, at.cells + places));
    copy.sigmas?.set(bytes.subarray(at.sigmas, at.sigmas + places));
    copy.interpolated?.set(bytes.subarray(at.marks, at.marks + places));
    chooseDiagonals(copy, head.spacing);
    return copy;
  }

  /** Whether toSurface() is worth what it has to work out for these points once. */
  takesPoints(points: GridPoints): boolean {
    const { grid } = this.decoded!;
    return points.straightRays || points.samples * grid.pictureLines <= kMostRays * grid.vertices;
  }

  /** As GridPoints.toSurface(), of what was decoded; into spare memory. */
  toSurface(points: GridPoints, spares: Spares): GridSurface {
    const { head, grid } = this.decoded!;
    this.startPoints(points, grid);
    const { at, bytes, floats, ints, unsigned } = this;
    const positions = spares.floats(grid.vertices * 3);
    const coordinates = spares.floats(grid.vertices * 2);
    const triangles = spares.indices(grid.triangles * 3);
    const told = head.hasSigmas || head.hasInterpolated;
    const quality = told ? { sigmas: spares.floats(grid.vertices), interpolated: spares.bytes(grid.vertices) } : null;
    const nextAt = (this.points >> 2) + kNextAt;
    let vertex = 0;
    let index = 0;
    for (let line = 0; line < grid.lines; line += kTogether) {
      if (this.exports.surface_lines(line, Math.min(line + kTogether, grid.lines)) === 0) {
        throw new Error('geometry has a ray that meets no light sheet');
      }
      const count = ints[nextAt]! - vertex;
      const indices = 3 * ints[(this.points >> 2) + kWrittenAt]!;
      positions.set(floats.subarray(at.positions >> 2, (at.positions >> 2) + 3 * count), 3 * vertex);
      coordinates.set(floats.subarray(at.coordinates >> 2, (at.coordinates >> 2) + 2 * count), 2 * vertex);
      triangles.set(unsigned.subarray(at.triangles >> 2, (at.triangles >> 2) + indices), index);
      if (quality !== null) {
        quality.sigmas.set(floats.subarray(at.depthSigmas >> 2, (at.depthSigmas >> 2) + count), vertex);
        quality.interpolated.set(bytes.subarray(at.depthMarks, at.depthMarks + count), vertex);
      }
      vertex += count;
      index += indices;
    }
    joinCopies(ints.subarray(at.columns >> 2, (at.columns >> 2) + placesOf(grid)), grid, triangles);
    return { positions, coordinates, triangles, quality };
  }

  /** Room for a grid. What of before lies elsewhere now has to be put there again. */
  private layOut(grid: GridShape): void {
    const shape = `${grid.boundaries} ${grid.lines}`;
    if (shape === this.shape) return;
    this.shape = shape;
    this.keyHere = null;
    this.pointsHere = null;
    this.end = kFirstFree;
    const at: Record<string, number> = {};
    for (const [name, size] of Object.entries(sizesOf(grid))) {
      at[name] = this.end;
      this.end += (size + 15) & ~15;
    }
    this.at = at as Places;
  }

  /** So many bytes behind what is laid out. */
  private reserve(size: number): void {
    const more = this.end + size + 16 - this.memory.buffer.byteLength;
    if (more > 0) this.memory.grow(Math.ceil(more / kPage));
    if (this.bytes.buffer === this.memory.buffer) return;
    this.bytes = new Uint8Array(this.memory.buffer);
    this.ints = new Int32Array(this.memory.buffer);
    this.unsigned = new Uint32Array(this.memory.buffer);
    this.floats = new Float32Array(this.memory.buffer);
  }

  private putTable(table: Table, index: number): void {
    const from = (this.at.tables >> 2) + index * kScale;
    if (table === null) this.unsigned.fill(255, from, from + kScale);
    else this.unsigned.set(table, from);
  }

  /** struct Job of wasm/grid.h. */
  private startJob({ head, key }: CodedGrid, grid: GridShape, begin: number, end: number, streams: number[]): void {
    const { at } = this;
    const table = (index: number): number => at.tables + 4 * kScale * index;
    const line = grid.stride + 16;
    const bytes = (index: number): number => at.lines + index * line;
    const cellTables = 8;
    const residualTables = 8;
    this.ints.set(
      [
        ...[at.columns, at.cells, head.hasSigmas ? at.sigmas : 0, head.hasInterpolated ? at.marks : 0, key === null ? 0 : at.key],
        ...[head.boundaries, head.lines, grid.stride, head.stepBits],
        ...[...head.slopes, head.keyWeight, head.keyChange, head.limit, head.spacing],
        ...[at.first, table(0), table(cellTables), table(cellTables + residualTables)],
        ...[begin, end, ...streams, 0, 0],
        ...Array.from({ length: 10 }, (_, i) => bytes(i)),
        at.numbers,
      ],
      this.job >> 2,
    );
  }

  /** struct Points of wasm/grid.h. */
  private startPoints(points: GridPoints, grid: GridShape): void {
    if (this.pointsHere !== points) this.loadPoints(points, grid);
    const { at } = this;
    const { camera, lineStep } = points.calibration;
    const line = 4 * (grid.stride + 16);
    const numbers = (index: number): number => at.numbers + index * line;
    const sheets = (index: number): number => at.sheets + index * line;
    const start = this.points >> 2;
    const whole = (from: number, ...values: number[]): void => this.ints.set(values, start + from);
    const real = (from: number, ...values: number[]): void => this.floats.set(values, start + from);
    whole(0, points.straightRays ? 0 : at.rays, points.samples);
    real(2, 2 ** -grid.stepBits, 1 / camera.fx, camera.cx / camera.fx, camera.skew / camera.fx, -camera.cy / camera.fy);
    real(7, lineStep / camera.fy, lineStep, 1 / camera.width, 1 / camera.height);
    whole(11, points.straightSheets ? 0 : at.curved);
    real(12, points.sheetFirst, points.sheetStep);
    whole(14, sheets(0), sheets(1), sheets(2), sheets(3), at.small, at.small + 36, at.small + 48);
    whole(kNextAt, 0, numbers(1), numbers(2), numbers(3), numbers(4), numbers(5), numbers(6), numbers(7));
    whole(29, at.positions, at.coordinates, at.depthSigmas, at.depthMarks, at.triangles, 0, grid.pictureLines);
  }

  /** What of a calibration does not change. */
  private loadPoints(points: GridPoints, grid: GridShape): void {
    const { rotation, translation, camera } = points.calibration;
    const rays = points.straightRays ? null : points.allRays();
    this.end = this.at.rays;
    this.reserve(rays === null ? 0 : rays.byteLength);
    if (rays !== null) {
      this.floats.set(rays, this.at.rays >> 2);
      this.end += (rays.byteLength + 15) & ~15;
    }
    const line = grid.stride + 16;
    [points.numerator, points.a, points.b, points.c].forEach((values, i) => this.floats.set(values, (this.at.sheets >> 2) + i * line));
    if (!points.straightSheets) this.floats.set(points.allSheets(), this.at.curved >> 2);
    this.floats.set([...rotation, ...translation, ...kSigmas.map((sigma) => sigma / camera.fx)], this.at.small >> 2);
    this.pointsHere = points;
  }
}
