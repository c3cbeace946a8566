// SPDX-License-Identifier: Apache-2.0
// Samples as they are in recordings: delimited CDR 2, little endian (idl/relievo.idl). Pure; any input.
import type { Pinhole, StreamInfo } from './protocol';

const kEncapsulationBytes = 4;
const kDelimitedCdr2 = 9;
const kMaxText = 4096;

/** Values are aligned to their size, at most to 4, from behind the encapsulation header. Throws beyond the end. */
class Cursor {
  private readonly view: DataView;
  private readonly base: number;
  private at: number;

  constructor(private readonly bytes: Uint8Array) {
    if (bytes.length < kEncapsulationBytes || bytes[0] !== 0 || bytes[1] !== kDelimitedCdr2) {
      throw new Error('a message in an encoding other than little-endian delimited CDR 2');
    }
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    this.base = this.at = kEncapsulationBytes;
  }

  u32(): number {
    return this.view.getUint32(this.take(4, 4), true);
  }
  u64(): number {
    return Number(this.view.getBigUint64(this.take(8, 4), true));
  }
  /** Nanoseconds as milliseconds, to a microsecond. */
  time(): number {
    return Number(this.view.getBigInt64(this.take(8, 4), true) / 1000n) / 1000;
  }
  double(): number {
    return this.view.getFloat64(this.take(8, 4), true);
  }
  doubles(count: number): number[] {
    return Array.from({ length: count }, () => this.double());
  }
  text(): string {
    const length = this.u32();
    if (length === 0 || length > kMaxText) throw new Error('a message with text of a wrong form');
    const at = this.take(length, 1);
    return new TextDecoder().decode(this.bytes.subarray(at, at + length - 1));
  }
  /** Where a sequence of octets begins, and how many there should be: the bytes given may end before. */
  octets(): { at: number; length: number } {
    const length = this.u32();
    return { at: this.at, length };
  }
  skip(count: number): void {
    this.take(count, 1);
  }
  /** `more`: whether a struct, of which read() gives the members, holds more than was read. What a newer server adds is left out. */
  appendable<T>(read: (more: () => boolean) => T): T {
    const length = this.u32();
    const end = this.at + length;
    const value = read(() => this.at < end);
    this.at = Math.max(this.at, end);
    return value;
  }

  private take(size: number, align: number): number {
    const at = this.base + Math.ceil((this.at - this.base) / align) * align;
    if (at + size > this.bytes.length) throw new Error('a message that ends too early');
    this.at = at + size;
    return at;
  }
}

export interface FrameHead {
  stream: string;
  sequence: number;
  number: number;
  captureMs: number;
  publishMs: number;
  at: number; // of the frame's bytes in the message
  length: number;
  isKey: boolean;
}

/** Of a relievo::Frame, from its first bytes (kFrameHeadBytes are enough). Throws where they make no sense. */
export function readFrameHead(bytes: Uint8Array): FrameHead {
  const cursor = new Cursor(bytes);
  cursor.u32(); // the struct's length
  const stream = cursor.text();
  const [sequence, number] = [cursor.u64(), cursor.u64()];
  const [captureMs, publishMs] = [cursor.time(), cursor.time()];
  const { at, length } = cursor.octets();
  const isFrame = bytes[at] === 0x52 && bytes[at + 1] === 0x4c && bytes[at + 2] === 0x56 && bytes[at + 3] === 0x46;
  if (!isFrame || bytes[at + 5] === undefined) throw new Error('a message without a frame');
  return { stream, sequence, number, captureMs, publishMs, at, length, isKey: (bytes[at + 5]! & 1) === 1 };
}

export const kFrameHeadBytes = 160;

/** Of a relievo::StreamInfo. Throws where the bytes make no sense. */
export function readStreamInfo(bytes: Uint8Array): StreamInfo {
  const cursor = new Cursor(bytes);
  cursor.u32();
  const [stream, source] = [cursor.text(), cursor.text()];
  cursor.time(); // started
  const rig = readRig(cursor);
  return { stream, source, ...rig, stripes: cursor.appendable(() => readStripes(cursor)) };
}

function readRig(cursor: Cursor): Omit<StreamInfo, 'stream' | 'source' | 'stripes'> {
  return cursor.appendable((more) => {
    const scan = cursor.u32() === 0 ? 'interlaced' : 'progressive';
    const frame_rate = cursor.double();
    const [camera, projector] = [readPinhole(cursor), readPinhole(cursor)];
    const { width, height, fx, fy, cx, cy, distortion = [] } = camera;
    const possible = width > 0 && height > 0 && [fx, fy, cx, cy, ...distortion].every(Number.isFinite) && fx > 0 && fy > 0;
    if (!possible) throw new Error('a description of an impossible camera');
    const projector_from_camera_rotation = cursor.doubles(9);
    const projector_from_camera_translation = cursor.doubles(3);
    cursor.doubles(9); // colours
    if (more()) cursor.u32(); // field order
    const [stereo_rms_px = 0, scale_error = 0] = more() ? cursor.doubles(2) : [];
    const pose = { projector, projector_from_camera_rotation, projector_from_camera_translation };
    const [rotation, translation] = more() ? [cursor.doubles(9), cursor.doubles(3)] : [[], []];
    const isPlaced = rotation.some((v) => v !== 0); // else it is not said
    const place = isPlaced ? { world_from_camera_rotation: rotation, world_from_camera_translation: translation } : {};
    const camera_gamma = (more() && cursor.double()) || 1; // 0 is not said, either
    return { frame_rate, scan, camera, ...pose, stereo_rms_px, scale_error, camera_gamma, ...place };
  });
}

/** How many there are, of a relievo::Pattern. */
function readStripes(cursor: Cursor): number {
  cursor.u32(); // colours
  cursor.u32(); // slides
  cursor.skip(cursor.u32()); // palette
  const stripes = cursor.u32();
  cursor.skip(4 * stripes); // throws where they are not all there
  return stripes;
}

function readPinhole(cursor: Cursor): Pinhole {
  cursor.u32();
  const [width, height] = [cursor.u32(), cursor.u32()];
  const matrix = cursor.doubles(9);
  return { width, height, fx: matrix[0]!, fy: matrix[4]!, cx: matrix[2]!, cy: matrix[5]!, distortion: cursor.doubles(5) };
}
