// SPDX-License-Identifier: Apache-2.0
// The stripe grid from its bytes: codec/FORMAT.md, "Geometry codec 2". The same steps as codec/grid_decoder.cpp.
import { readGridHead, type GridFields, type GridHead } from './gridHead';
import { BitReader, Decoder, readFirstFrequency, readLevels, tableOf, type Table } from './rans';

export const kAbsent = -(1 << 30);
export const kMargin = 8;
export const kMostPixels = 1 << 14;

/** A cell with both triangles: on the diagonal from corner 0 to 2, or from 1 to 3. Else bit c: the one without corner c. */
export const kStraight = 10;
export const kTurned = 5;
export const kBoth = 255;

const kPlaceTables = 32;
const kBlockTable = kPlaceTables;
const kCellTable = kBlockTable + 2;
const kCellTables = 8;
const kCellBlockTable = kCellTable + kCellTables;
const kMarkTable = kCellBlockTable + 1;
const kControlTables = kMarkTable + 4;
const kResidualTables = 8;
const kAlone = 7;
const kFirstSize = 1;
const kLargestSize = 60;
const kSigmaTables = 5;
export const kFirstSigma = 32;
const kDirect = 48;

export interface GridShape {
  boundaries: number;
  lines: number;
  pictureLines: number; // half of them where second places have lines of their own, else all
  stepBits: number;
  stride: number; // places of a line with its margins; the first place is at line * stride + kMargin
  vertices: number;
  triangles: number;
}

export interface Grid extends GridShape {
  columns: Int32Array; // steps; kAbsent: no vertex
  cells: Uint8Array;
  sigmas: Uint8Array | null; // codes
  interpolated: Uint8Array | null;
}

/** What others build on. */
export interface KeyGrid {
  id: number;
  grid: Pick<Grid, 'boundaries' | 'lines' | 'pictureLines' | 'stepBits' | 'columns'>;
}

/** A grid whose slices are still to be decoded. */
export interface CodedGrid {
  head: GridHead;
  tables: Tables;
  slices: (SliceHead | null)[]; // null: lost
  key: KeyGrid | null; // what it builds on
}

export const damaged = (): Error => new Error('geometry is damaged');

export interface Tables {
  first: Uint16Array; // of alphabets of two
  cells: Table[];
  residuals: Table[];
  sigmas: Table[];
}

function readTables(bytes: Uint8Array, hasSigmas: boolean): Tables {
  const bits = new BitReader(bytes);
  const several = (count: number): Table[] => Array.from({ length: count }, () => tableOf(readLevels(bits)));
  const first = new Uint16Array(kControlTables);
  const cells: Table[] = [];
  for (let t = 0; t < kControlTables; ++t) {
    if (t >= kCellTable && t < kCellTable + kCellTables) cells.push(tableOf(readLevels(bits)));
    else first[t] = readFirstFrequency(bits);
  }
  const residuals = several(kResidualTables);
  const sigmas = hasSigmas ? several(kSigmaTables) : [];
  if (bits.position !== bytes.length) throw damaged();
  return { first, cells, residuals, sigmas };
}

export interface SliceHead {
  bytes: number;
  vertices: number;
  triangles: number;
  control: Uint8Array;
  residuals: Uint8Array;
  sigmas: Uint8Array;
  raw: Uint8Array;
}

function readSliceHead(bytes: Uint8Array): SliceHead {
  let at = 0;
  const varint = (): number => {
    let value = 0;
    for (let scale = 1; scale <= 2 ** 28; scale *= 128) {
      const byte = bytes[at++];
      if (byte === undefined) throw damaged();
      value += (byte & 0x7f) * scale;
      if (byte < 0x80) return value;
    }
    throw damaged();
  };
  const [vertices, triangles, ...sizes] = [varint(), varint(), varint(), varint(), varint()] as [
    number,
    number,
    number,
    number,
    number,
  ];
  const take = (size: number): Uint8Array => {
    if (size > bytes.length - at) throw damaged();
    at += size;
    return bytes.subarray(at - size, at);
  };
  const [control, residuals, sigmas] = sizes.map(take) as [Uint8Array, Uint8Array, Uint8Array];
  return { bytes: bytes.length, vertices, triangles, control, residuals, sigmas, raw: bytes.subarray(at) };
}

function numberOf(symbol: number, raw: BitReader): number {
  if (symbol < kDirect) return symbol;
  const bits = symbol - kDirect + 3;
  return 2 ** bits + raw.get(bits) - 8 + kDirect;
}

const unzigzag = (z: number): number => (z >>> 1) ^ -(z & 1);

/** Lines [begin, end) of the grid. */
class Slice {
  private readonly there: Uint8Array; // [line, one before the slice and one behind it][place]
  private goodAbove: Uint8Array;
  private goodHere: Uint8Array;
  private readonly sizes: Uint8Array;
  private readonly tables: Uint8Array;
  private readonly symbols: Uint8Array;
  private readonly places: Int32Array;
  private readonly expected: Int32Array;
  private readonly absent: Int32Array;
  private readonly control: Decoder;
  private readonly residuals: Decoder;
  private readonly raw: BitReader;
  vertices = 0;
  triangles = 0;

  constructor(
    private readonly head: GridHead,
    private readonly all: Tables,
    private readonly key: KeyGrid['grid'] | null,
    private readonly grid: Grid,
    private readonly begin: number,
    private readonly end: number,
    private readonly slice: SliceHead,
  ) {
    const { stride } = grid;
    this.there = new Uint8Array((end - begin + 2) * stride);
    this.goodAbove = new Uint8Array(stride).fill(1);
    this.goodHere = new Uint8Array(stride).fill(1);
    this.sizes = new Uint8Array(stride).fill(kFirstSize);
    this.tables = new Uint8Array(stride);
    this.symbols = new Uint8Array(stride);
    this.places = new Int32Array(stride);
    this.expected = new Int32Array(stride);
    this.absent = new Int32Array(stride).fill(kAbsent);
    this.control = new Decoder(slice.control, 1);
    this.residuals = new Decoder(slice.residuals, 4);
    this.raw = new BitReader(slice.raw);
  }

  decode(): void {
    const { head, slice } = this;
    const sigmas = head.hasSigmas ? new Decoder(slice.sigmas, 4) : null;
    this.readPlaces(this.begin);
    for (let line = this.begin; line < this.end; ++line) {
      if (head.hasInterpolated) this.readMarks(line);
      if (line + 1 < head.lines) {
        this.readPlaces(line + 1);
        this.readCells(line);
      }
      this.readColumns(line);
      if (sigmas !== null) this.readSigmas(line, sigmas);
      if (this.vertices > slice.vertices || this.triangles > slice.triangles) throw damaged();
    }
    const done =
      this.vertices === slice.vertices &&
      this.triangles === slice.triangles &&
      this.control.finished &&
      this.residuals.finished &&
      (sigmas === null || sigmas.finished) &&
      this.raw.position === slice.raw.length;
    if (!done) throw damaged();
  }

  private thereAt(line: number): number {
    return (line - this.begin + 1) * this.grid.stride + kMargin;
  }

  private readPlaces(line: number): void {
    const { there, control, all, key } = this;
    const { boundaries, stride } = this.grid;
    const here = this.thereAt(line);
    const above = here - stride;
    const keyAt = line * stride + kMargin;
    const keys = key?.columns ?? null;
    for (let b = 0; b < boundaries; b += 8) {
      const last = Math.min(b + 8, boundaries);
      if (last - b === 8) {
        const v = there[here + b - 1]!;
        let uniform = true;
        for (let i = b - 1; i <= b + 8 && uniform; ++i) uniform = there[above + i] === v;
        if (keys !== null) {
          for (let i = b; i < last && uniform; ++i) uniform = (keys[keyAt + i] === kAbsent ? 0 : 1) === v;
        }
        if (uniform) {
          if (control.two(all.first[kBlockTable + v]!) === 0) {
            there.fill(v, here + b, here + last);
            continue;
          }
        }
      }
      for (let i = b; i < last; ++i) {
        const context =
          there[here + i - 1]! |
          (there[above + i]! << 1) |
          (there[above + i + 1]! << 2) |
          (there[above + i - 1]! << 3) |
          (keys !== null && keys[keyAt + i] !== kAbsent ? 16 : 0);
        there[here + i] = control.two(all.first[context]!);
      }
    }
  }

  private readCells(line: number): void {
    const { there, control, all, goodAbove, goodHere } = this;
    const { cells, stride } = this.grid;
    const above = this.thereAt(line);
    const below = above + stride;
    const cellAt = line * stride + kMargin;
    const count = this.grid.boundaries - 1;
    goodHere[kMargin - 1] = 1;
    for (let b = 0; b < count; b += 8) {
      const last = Math.min(b + 8, count);
      if (last - b === 8 && goodHere[kMargin + b - 1] === 1) {
        let whole = there[above + b + 8]! & there[below + b + 8]!;
        for (let i = b; i < last && whole === 1; ++i) {
          whole = there[above + i]! & there[below + i]! & goodAbove[kMargin + i]!;
        }
        if (whole === 1 && control.two(all.first[kCellBlockTable]!) === 0) {
          cells.fill(kBoth, cellAt + b, cellAt + last);
          goodHere.fill(1, kMargin + b, kMargin + last);
          this.triangles += 16;
          continue;
        }
      }
      for (let i = b; i < last; ++i) {
        const c0 = there[above + i]!;
        const c1 = there[below + i]!;
        const c2 = there[below + i + 1]!;
        const c3 = there[above + i + 1]!;
        const corners = c0 + c1 + c2 + c3;
        goodHere[kMargin + i] = 0;
        if (corners < 3) continue;
        const table = (corners === 4 ? 4 : 0) + 2 * goodHere[kMargin + i - 1]! + goodAbove[kMargin + i]!;
        const symbol = control.one(all.cells[table]!);
        if (symbol > 5 || (corners === 3 && symbol > 1)) throw damaged();
        if (symbol === 0) goodHere[kMargin + i] = 1;
        if (symbol === 1) continue;
        this.triangles += symbol === 0 && corners === 4 ? 2 : 1;
        if (corners === 3) cells[cellAt + i] = c0 === 0 ? 1 : c1 === 0 ? 2 : c2 === 0 ? 4 : 8;
        else cells[cellAt + i] = symbol === 0 ? kBoth : 1 << (symbol - 2);
      }
    }
    [this.goodAbove, this.goodHere] = [goodHere, goodAbove];
  }

  private readMarks(line: number): void {
    const marks = this.grid.interpolated!;
    const here = this.thereAt(line);
    const at = line * this.grid.stride + kMargin;
    for (let b = 0; b < this.grid.boundaries; ++b) {
      if (this.there[here + b] === 0) continue;
      const above = line > this.begin ? marks[at + b - this.grid.stride]! : 0;
      marks[at + b] = this.control.two(this.all.first[kMarkTable + (above << 1) + marks[at + b - 1]!]!);
    }
  }

  private readColumns(line: number): void {
    const { head, grid, key, absent, sizes, tables, symbols, places, expected, there, raw } = this;
    const { boundaries, stride, columns } = grid;
    const here = line * stride + kMargin;
    const row = (l: number): Int32Array =>
      l < this.begin ? absent : columns.subarray(l * stride, (l + 1) * stride);
    const [up1, up2, up3, up4] = [row(line - 1), row(line - 2), row(line - 3), row(line - 4)];
    const keyHere = key === null ? null : key.columns.subarray(line * stride, (line + 1) * stride);
    const keyUp =
      key === null ? absent : line - 1 < this.begin ? absent : key.columns.subarray((line - 1) * stride, line * stride);
    const { limit, spacing } = head;
    const [slope1, slope2, slope3] = head.slopes;
    const thereAt = this.thereAt(line);
    let count = 0;
    for (let b = 0; b < boundaries; ++b) {
      if (there[thereAt + b] === 0) continue;
      const i = b + kMargin;
      places[count] = i;
      const up = up1[i]!;
      if (up === kAbsent) {
        tables[count++] = kAlone;
        continue;
      }
      const t = sizes[i - 1]! + 2 * sizes[i]! + sizes[i + 1]!;
      tables[count++] = t === 0 ? 0 : t < 2 ? 1 : t < 4 ? 2 : t < 8 ? 3 : t < 16 ? 4 : t < 32 ? 5 : 6;
      let d1 = up - up2[i]!;
      let d2 = up2[i]! - up3[i]!;
      let d3 = up3[i]! - up4[i]!;
      if (d1 > limit || d1 < -limit) d1 = 0;
      if (d2 > limit || d2 < -limit) d2 = 0;
      if (d3 > limit || d3 < -limit) d3 = 0;
      let p = up + ((slope1 * d1 + slope2 * d2 + slope3 * d3 + 128) >> 8);
      if (keyHere !== null) {
        const change = up - keyUp[i]!;
        const d = keyHere[i]! - p;
        if (change <= limit && change >= -limit && d <= limit && d >= -limit) {
          p += (head.keyWeight * d + head.keyChange * change + 128) >> 8;
        }
      }
      expected[i] = p;
    }
    this.residuals.row(this.all.residuals, tables, count, symbols);
    const most = kMostPixels << grid.stepBits;
    let lastColumn = 0;
    let lastPlace = kMargin;
    for (let k = 0; k < count; ++k) {
      const i = places[k]!;
      const d = unzigzag(numberOf(symbols[k]!, raw));
      let p: number;
      if (tables[k] !== kAlone) {
        p = expected[i]!;
      } else {
        const at = here - kMargin + i;
        const left = columns[at - 1]!;
        const left2 = columns[at - 2]!;
        if (keyHere !== null && keyHere[i] !== kAbsent) p = keyHere[i]!;
        else if (left !== kAbsent) p = left2 !== kAbsent ? 2 * left - left2 : left + spacing;
        else if (up1[i + 1] !== kAbsent) p = up1[i + 1]! - spacing;
        else p = lastColumn + (i - lastPlace) * spacing;
      }
      const column = p + d;
      if (column < -most || column > most) throw damaged();
      columns[here - kMargin + i] = column;
      lastColumn = column;
      lastPlace = i;
      sizes[i] = Math.min(Math.abs(d), kLargestSize);
    }
    this.vertices += count;
  }

  private readSigmas(line: number, decoder: Decoder): void {
    const { grid, tables, symbols, places, raw } = this;
    const { columns, stride, boundaries } = grid;
    const codes = grid.sigmas!;
    const here = line * stride + kMargin;
    const above = line - 1 >= this.begin;
    const further = line - 2 >= this.begin;
    let count = 0;
    for (let b = 0; b < boundaries; ++b) {
      const at = here + b;
      if (columns[at] === kAbsent) continue;
      places[count] = at;
      if (!above || columns[at - stride] === kAbsent) {
        tables[count++] = kSigmaTables - 1;
      } else if (!further || columns[at - 2 * stride] === kAbsent) {
        tables[count++] = 0;
      } else {
        tables[count++] = Math.min(Math.abs(codes[at - stride]! - codes[at - 2 * stride]!), kSigmaTables - 2);
      }
    }
    decoder.row(this.all.sigmas, tables, count, symbols);
    let last = kFirstSigma;
    for (let k = 0; k < count; ++k) {
      const at = places[k]!;
      const from = above && columns[at - stride] !== kAbsent ? codes[at - stride]! : last;
      const code = unzigzag(numberOf(symbols[k]!, raw)) + from;
      if (code < 0 || code > 63) throw damaged();
      codes[at] = code;
      last = code;
    }
  }
}

/** Of the cells with both triangles. */
export function chooseDiagonals(grid: Grid, spacing: number): void {
  const { columns, cells, stride } = grid;
  for (let line = 0; line + 1 < grid.lines; ++line) {
    const above = line * stride + kMargin;
    const below = above + stride;
    for (let b = 0; b + 1 < grid.boundaries; ++b) {
      if (cells[above + b] !== kBoth) continue;
      const falling = Math.abs(columns[below + b + 1]! - columns[above + b]! - spacing);
      const rising = Math.abs(columns[above + b + 1]! - columns[below + b]! - spacing);
      cells[above + b] = falling <= rising ? kStraight : kTurned;
    }
  }
}

const kTrianglesOf = Uint8Array.from({ length: 256 }, (_, cell) =>
  cell === kBoth ? 2 : (cell & 1) + ((cell >> 1) & 1) + ((cell >> 2) & 1) + ((cell >> 3) & 1),
);

export function shapeOf({ boundaries, lines, twice, stepBits }: GridFields): GridShape {
  const stride = ((boundaries + 7) >> 3) * 8 + 2 * kMargin;
  return { boundaries, lines, pictureLines: twice ? lines / 2 : lines, stepBits, stride, vertices: 0, triangles: 0 };
}
export const placesOf = ({ lines, stride }: GridShape): number => lines * stride + kMargin;

/** Of that size, with nothing in it. */
export function emptyGrid(fields: GridFields): Grid {
  const shape = shapeOf(fields);
  const size = placesOf(shape);
  return {
    ...shape,
    columns: new Int32Array(size).fill(kAbsent),
    cells: new Uint8Array(size),
    sigmas: fields.hasSigmas ? new Uint8Array(size) : null,
    interpolated: fields.hasInterpolated ? new Uint8Array(size) : null,
  };
}

/** Throws where there are triangles between the picture's last line and its first line again, which no grid has. */
export function checkHalves(cells: Uint8Array, { lines, pictureLines, stride, boundaries }: GridShape): void {
  const at = (pictureLines - 1) * stride + kMargin;
  if (pictureLines < lines && cells.subarray(at, at + boundaries).some((cell) => cell !== 0)) throw damaged();
}

/** Takes the triangles below a line away, and says how many there were. */
export function dropCells(cells: Uint8Array, { stride, boundaries }: GridShape, line: number): number {
  const at = line * stride + kMargin;
  let dropped = 0;
  for (let b = 0; b < boundaries; ++b) dropped += kTrianglesOf[cells[at + b]!]!;
  cells.fill(0, at, at + boundaries);
  return dropped;
}

/** Fails unless the grid holds what the frame declares, less where slices are lost. Any input. */
export function openGrid(bytes: Uint8Array, vertices: number, triangles: number, key: KeyGrid | null): CodedGrid {
  const head = readGridHead(bytes);
  if (!head.isKey && (key === null || key.id !== head.key)) throw new Error('geometry builds on a key frame that was not received');
  const known = head.isKey ? null : key;
  const shape = shapeOf(head);
  const alike = (['boundaries', 'lines', 'pictureLines', 'stepBits'] as const).every((size) => known === null || known.grid[size] === shape[size]);
  if (!alike) {
    throw new Error('geometry is of another size than its key frame');
  }
  const slices = head.slices.map((slice) => (slice.length === 0 ? null : readSliceHead(slice)));
  const declared = (of: (s: SliceHead) => number): number => slices.reduce((sum, s) => sum + (s === null ? 0 : of(s)), 0);
  const [v, t] = [declared((s) => s.vertices), declared((s) => s.triangles)];
  if (v > vertices || t > triangles || (!slices.includes(null) && (v !== vertices || t !== triangles))) {
    throw new Error('geometry is not of the size that the frame declares');
  }
  return { head, tables: readTables(head.tables, head.hasSigmas), slices, key: known };
}

/** Throws. Any input. */
export function decodeSlices({ head, tables, slices, key }: CodedGrid): Grid {
  const grid = emptyGrid(head);
  slices.forEach((slice, s) => {
    const begin = s * head.sliceLines;
    if (slice !== null) {
      const decoder = new Slice(head, tables, key === null ? null : key.grid, grid, begin, Math.min(begin + head.sliceLines, head.lines), slice);
      decoder.decode();
      grid.vertices += decoder.vertices;
      grid.triangles += decoder.triangles;
    } else if (s > 0) {
      grid.triangles -= dropCells(grid.cells, grid, begin - 1); // on vertices that are lost
    }
  });
  checkHalves(grid.cells, grid);
  chooseDiagonals(grid, head.spacing);
  return grid;
}
