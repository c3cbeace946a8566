// SPDX-License-Identifier: Apache-2.0
// The head of a coded grid: codec/FORMAT.md, "Geometry codec 2"; codec 3 has most of it. Pure.
import type { Lens } from './lens';

export interface Calibration {
  lineStep: number; // rows of the camera from line to line
  camera: Lens;
  projector: Lens;
  rotation: number[]; // projector from camera, row-major
  translation: number[]; // metres
  stripes: number;
}

/** What codecs 2 and 3 share. */
export interface GridFields {
  isKey: boolean;
  hasSigmas: boolean;
  hasInterpolated: boolean;
  stepBits: number;
  boundaries: number;
  lines: number;
  twice: boolean; // the picture's lines, then the same ones again
  sliceLines: number;
  slopes: [number, number, number]; // of 256
  keyWeight: number;
  keyChange: number;
  limit: number; // steps
  spacing: number; // steps
  stepMm: number;
  key: number; // of a delta grid: the id of the key grid it builds on
  calibration: Calibration | null; // of a key grid
  calibrationBytes: Uint8Array; // the same as sent
}

export interface GridHead extends GridFields {
  tables: Uint8Array;
  slices: Uint8Array[]; // empty: lost
}

const kMostPlaces = 16384;
const kMostGridPlaces = 2 ** 24;
const kMostPlacesPerByte = 4096;

export class Reader {
  at = 0;
  private readonly view: DataView;
  constructor(private readonly bytes: Uint8Array) {
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  }
  private next(size: number): number {
    if (this.at + size > this.bytes.length) throw new Error('geometry is cut short');
    this.at += size;
    return this.at - size;
  }
  u8 = (): number => this.view.getUint8(this.next(1));
  u16 = (): number => this.view.getUint16(this.next(2), true);
  i16 = (): number => this.view.getInt16(this.next(2), true);
  u32 = (): number => this.view.getUint32(this.next(4), true);
  i32 = (): number => this.view.getInt32(this.next(4), true);
  f32 = (): number => this.view.getFloat32(this.next(4), true);
  take(size: number): Uint8Array {
    const at = this.next(size);
    return this.bytes.subarray(at, at + size);
  }
  /** What was read from `at` on. */
  since(at: number): Uint8Array {
    return this.bytes.subarray(at, this.at);
  }
}

function readLens(in_: Reader, distorted: boolean): Lens {
  const [width, height] = [in_.u16(), in_.u16()];
  const [fx, skew, cx, fy, cy] = [in_.f32(), in_.f32(), in_.f32(), in_.f32(), in_.f32()];
  const distortion: Lens['distortion'] = distorted
    ? [in_.f32(), in_.f32(), in_.f32(), in_.f32(), in_.f32()]
    : [0, 0, 0, 0, 0];
  return { width, height, fx, skew, cx, fy, cy, distortion };
}

const fair = (x: number): boolean => Number.isFinite(x) && Math.abs(x) < 1e6;
const usable = (l: Lens): boolean =>
  l.width > 0 &&
  l.width <= kMostPlaces &&
  l.height > 0 &&
  l.height <= kMostPlaces &&
  [l.fx, l.skew, l.cx, l.fy, l.cy, ...l.distortion].every(fair) &&
  l.fx > 1 &&
  l.fy > 1;

/** Rows of the picture that are lines. */
export const linesOf = ({ camera, lineStep }: Calibration): number => Math.floor((camera.height + lineStep - 1) / lineStep);

function readCalibration(in_: Reader, boundaries: number, pictureLines: number): Calibration {
  const flags = in_.u8();
  const lineStep = in_.u8();
  const camera = readLens(in_, (flags & 1) !== 0);
  const projector = readLens(in_, (flags & 2) !== 0);
  const rotation = Array.from({ length: 9 }, () => in_.f32());
  const translation = Array.from({ length: 3 }, () => in_.f32());
  const calibration = { lineStep, camera, projector, rotation, translation, stripes: boundaries + 1 };
  const good =
    flags <= 3 &&
    lineStep >= 1 &&
    usable(camera) &&
    usable(projector) &&
    linesOf(calibration) === pictureLines &&
    [...rotation, ...translation].every(fair);
  if (!good) throw new Error('geometry has a calibration that no rig can have');
  return calibration;
}

/** Throws an Error that says what is wrong; any input. `sectionBytes`: of the whole geometry. */
export function readGridFields(in_: Reader, sectionBytes: number): GridFields {
  const flags = in_.u8();
  if (flags > 15) throw new Error('geometry has flags that this viewer does not know');
  const isKey = (flags & 1) !== 0;
  const twice = (flags & 8) !== 0;
  const stepBits = in_.u8();
  const [boundaries, lines, sliceLines] = [in_.u16(), in_.u16(), in_.u16()];
  const slopes: [number, number, number] = [in_.i16(), in_.i16(), in_.i16()];
  const [keyWeight, keyChange] = [in_.i16(), in_.i16()];
  const [limit, spacing, stepMm] = [in_.u16(), in_.i32(), in_.f32()];
  const weights = [...slopes, keyWeight, keyChange];
  if (weights.some((w) => Math.abs(w) > 1024) || limit > 4096 || Math.abs(spacing) > 1 << 15) {
    throw new Error('geometry has a prediction out of bounds');
  }
  const sized =
    boundaries >= 1 &&
    boundaries <= kMostPlaces &&
    lines >= 1 &&
    lines <= kMostPlaces &&
    (!twice || lines % 2 === 0) &&
    sliceLines >= 1 &&
    sliceLines <= lines &&
    stepBits <= 8;
  const places = boundaries * lines;
  if (!sized || places > kMostGridPlaces || places > kMostPlacesPerByte * sectionBytes) {
    throw new Error('geometry has a size out of bounds');
  }
  const calibrationAt = in_.at;
  const calibration = isKey ? readCalibration(in_, boundaries, twice ? lines / 2 : lines) : null;
  const calibrationBytes = in_.since(calibrationAt);
  const key = isKey ? 0 : in_.u32();
  return {
    isKey,
    hasSigmas: (flags & 2) !== 0,
    hasInterpolated: (flags & 4) !== 0,
    stepBits,
    boundaries,
    lines,
    twice,
    sliceLines,
    slopes,
    keyWeight,
    keyChange,
    limit,
    spacing,
    stepMm,
    key,
    calibration,
    calibrationBytes,
  };
}

/** Throws an Error that says what is wrong; any input. */
export function readGridHead(bytes: Uint8Array): GridHead {
  const in_ = new Reader(bytes);
  const fields = readGridFields(in_, bytes.length);
  const tables = in_.take(in_.u16());
  const count = Math.ceil(fields.lines / fields.sliceLines);
  const sizes = Array.from({ length: count }, () => in_.u32());
  const slices = sizes.map((size) => in_.take(size));
  if (bytes.subarray(in_.at).some((b) => b !== 0)) throw new Error('geometry has bytes behind its end');
  return { ...fields, tables, slices };
}

/** Names a key grid: a hash of its coded bytes. */
export function gridId(bytes: Uint8Array): number {
  let hash = 0x811c9dc5;
  for (let i = 0; i < bytes.length; ++i) hash = Math.imul(hash ^ bytes[i]!, 0x01000193);
  return hash >>> 0;
}
