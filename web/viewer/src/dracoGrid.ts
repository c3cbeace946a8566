// SPDX-License-Identifier: Apache-2.0
// Geometry codec 3 of codec/FORMAT.md: the stripe grid in two Draco point clouds. The same steps as codec/draco_grid.cpp.
import type { DracoDecoder } from './draco';
import {
  checkHalves,
  chooseDiagonals,
  damaged,
  emptyGrid,
  kAbsent,
  kBoth,
  kFirstSigma,
  kMargin,
  kMostPixels,
  type Grid,
} from './gridDecoder';
import { readGridFields, Reader, type GridFields } from './gridHead';

const kMostChangesPerVertex = 4;
const kMostSigma = 63;

interface Layout {
  head: GridFields;
  vertices: Uint8Array; // Draco streams
  places: Uint8Array;
}

function readLayout(bytes: Uint8Array): Layout {
  if (bytes.length < 2) throw new Error('geometry is cut short');
  const tailBytes = new Reader(bytes.subarray(-2)).u16();
  if (tailBytes > bytes.length) throw new Error('geometry is cut short');
  const streams = new Reader(bytes.subarray(0, bytes.length - tailBytes));
  const tail = new Reader(bytes.subarray(bytes.length - tailBytes));
  const head = readGridFields(tail, bytes.length);
  if (!head.isKey || head.sliceLines !== head.lines || head.keyWeight !== 0 || head.keyChange !== 0) {
    throw new Error('geometry is of a kind not allowed');
  }
  const vertices = streams.take(tail.u32());
  const places = streams.take(tail.u32());
  if (tail.at + 2 !== tailBytes) throw new Error('geometry is cut short');
  if (bytes.subarray(streams.at, bytes.length - tailBytes).some((b) => b !== 0)) {
    throw new Error('geometry has bytes between its parts');
  }
  return { head, vertices, places };
}

/** The number that Draco makes of one of either sign. */
const zigzag = (d: number): number => (d >= 0 ? 2 * d : -2 * d - 1);

/** What changes at each place, at its index in the grid. */
function spreadChanges(runs: Int32Array, changes: Int32Array, grid: Grid): Uint8Array {
  const out = new Uint8Array(grid.columns.length);
  const places = grid.boundaries * grid.lines;
  let place = 0;
  for (let i = 0; i < runs.length; ++i, ++place) {
    place += zigzag(runs[i]!);
    const change = zigzag(changes[i]!);
    if (place >= places || change === 0 || change >= 12) throw damaged();
    const line = Math.floor(place / grid.boundaries);
    out[line * grid.stride + kMargin + (place - line * grid.boundaries)] = change;
  }
  return out;
}

/** Which places hold a vertex; counts them. */
function findPlaces(changes: Uint8Array, grid: Grid): Uint8Array {
  const there = new Uint8Array(changes.length);
  for (let line = 0; line < grid.lines; ++line) {
    const begin = line * grid.stride + kMargin;
    for (let at = begin; at < begin + grid.boundaries; ++at) {
      const v = (line > 0 ? there[at - grid.stride]! : 0) ^ (changes[at]! & 1);
      there[at] = v;
      grid.vertices += v;
    }
  }
  return there;
}

/** Fills the cells and counts their triangles. */
function fillCells(changes: Uint8Array, there: Uint8Array, grid: Grid): void {
  const { boundaries, lines, stride, cells } = grid;
  for (let line = 0; line < lines; ++line) {
    for (let b = 0; b < boundaries; ++b) {
      const at = line * stride + kMargin + b;
      const symbol = changes[at]! >> 1;
      const inside = line + 1 < lines && b + 1 < boundaries;
      const corners = inside ? there[at]! + there[at + stride]! + there[at + stride + 1]! + there[at + 1]! : 0;
      if (symbol > (corners === 4 ? 5 : corners === 3 ? 1 : 0)) throw damaged();
      if (corners < 3 || symbol === 1) continue;
      grid.triangles += symbol === 0 && corners === 4 ? 2 : 1;
      if (corners === 4) cells[at] = symbol === 0 ? kBoth : 1 << (symbol - 2);
      else cells[at] = there[at] === 0 ? 1 : there[at + stride] === 0 ? 2 : there[at + stride + 1] === 0 ? 4 : 8;
    }
  }
}

/** The lists of the vertices' cloud. */
interface VertexLists {
  columns: Int32Array;
  sigmas: Int32Array | null;
  marks: Int32Array | null;
}

function placeVertices(lists: VertexLists, head: GridFields, there: Uint8Array, grid: Grid): void {
  const { columns, stride, boundaries } = grid;
  const { limit, spacing } = head;
  const [slope1, slope2, slope3] = head.slopes;
  const most = kMostPixels << grid.stepBits;
  const near = (d: number): number => (d > limit || d < -limit ? 0 : d);
  const column = (at: number, line: number): number => (line < 0 ? kAbsent : columns[at]!);
  let n = 0;
  let mark = 0;
  for (let line = 0; line < grid.lines; ++line) {
    let lastColumn = 0;
    let lastPlace = 0;
    let lastSigma = kFirstSigma;
    for (let b = 0; b < boundaries; ++b) {
      const at = line * stride + kMargin + b;
      if (there[at] === 0) continue;
      const up1 = column(at - stride, line - 1);
      let p: number;
      if (up1 !== kAbsent) {
        const up2 = column(at - 2 * stride, line - 2);
        const up3 = column(at - 3 * stride, line - 3);
        const up4 = column(at - 4 * stride, line - 4);
        p = up1 + ((slope1 * near(up1 - up2) + slope2 * near(up2 - up3) + slope3 * near(up3 - up4) + 128) >> 8);
      } else {
        const left = columns[at - 1]!;
        const left2 = columns[at - 2]!;
        const right = column(at - stride + 1, line - 1);
        if (left !== kAbsent) p = left2 !== kAbsent ? 2 * left - left2 : left + spacing;
        else if (right !== kAbsent) p = right - spacing;
        else p = lastColumn + (b - lastPlace) * spacing;
      }
      const found = p + lists.columns[n]!;
      if (found < -most || found > most) throw damaged();
      columns[at] = lastColumn = found;
      lastPlace = b;
      if (lists.sigmas !== null) {
        const code = (up1 !== kAbsent ? grid.sigmas![at - stride]! : lastSigma) + lists.sigmas[n]!;
        if (code < 0 || code > kMostSigma) throw damaged();
        grid.sigmas![at] = lastSigma = code;
      }
      if (lists.marks !== null) {
        const change = zigzag(lists.marks[n]!);
        if (change > 1) throw damaged();
        grid.interpolated![at] = mark ^= change;
      }
      ++n;
    }
  }
}

/** Fails unless the grid holds what the frame declares. Any input. */
export function decodeDracoGrid(
  bytes: Uint8Array,
  vertices: number,
  triangles: number,
  draco: DracoDecoder,
): { head: GridFields; grid: Grid } {
  const { head, ...streams } = readLayout(bytes);
  const [runs, changes] = draco.numbers(streams.places, { atMost: kMostChangesPerVertex * vertices }, 2) as [
    Int32Array,
    Int32Array,
  ];
  const grid = emptyGrid(head);
  const changed = spreadChanges(runs, changes, grid);
  const there = findPlaces(changed, grid);
  fillCells(changed, there, grid);
  checkHalves(grid.cells, grid);
  if (grid.vertices !== vertices || grid.triangles !== triangles) {
    throw new Error('geometry is not of the size that the frame declares');
  }
  const count = 1 + (head.hasSigmas ? 1 : 0) + (head.hasInterpolated ? 1 : 0);
  const lists = draco.numbers(streams.vertices, { exactly: vertices }, count);
  placeVertices(
    {
      columns: lists[0]!,
      sigmas: head.hasSigmas ? lists[1]! : null,
      marks: head.hasInterpolated ? lists[count - 1]! : null,
    },
    head,
    there,
    grid,
  );
  chooseDiagonals(grid, head.spacing);
  return { head, grid };
}
