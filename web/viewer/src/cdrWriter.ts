// SPDX-License-Identifier: Apache-2.0
// Samples as recordings hold them: delimited CDR 2, little endian (idl/relievo.idl). What cdr.ts reads.
import type { Pinhole, StreamInfo } from './protocol';

const kEncapsulation = [0, 9, 0, 0]; // delimited CDR 2, little endian
const kScans = ['interlaced', 'progressive'];
const kFieldOrders = ['top', 'bottom'];
const kSchemes = ['complementary', 'white-field', 'white-frame', 'one-slide'];

/** Values are aligned to their size, at most to 4. */
class Sample {
  private bytes: Uint8Array;
  private view: DataView;
  private at = kEncapsulation.length;

  constructor(room: number) {
    this.bytes = new Uint8Array(room);
    this.view = new DataView(this.bytes.buffer);
    this.bytes.set(kEncapsulation);
  }

  u32(value: number): void {
    this.view.setUint32(this.take(4), value, true);
  }
  i64(value: bigint): void {
    this.view.setBigInt64(this.take(8), value, true);
  }
  doubles(values: readonly number[]): void {
    for (const value of values) this.view.setFloat64(this.take(8), value, true);
  }
  text(value: string): void {
    this.octets(new TextEncoder().encode(`${value}\0`));
  }
  octets(values: Uint8Array): void {
    this.u32(values.length);
    const at = this.take(values.length, 1);
    this.bytes.set(values, at);
  }
  /** A struct behind its length. */
  appendable(write: () => void): void {
    this.u32(0);
    const start = this.at;
    write();
    this.view.setUint32(start - 4, this.at - start, true);
  }
  /** Filled up to whole words; the head says by how much. */
  finish(): Uint8Array {
    const end = this.at;
    const whole = Math.ceil(end / 4) * 4;
    this.room(whole);
    this.bytes[3] = whole - end;
    return this.bytes.slice(0, whole);
  }

  private take(size: number, align = 4): number {
    const at = Math.ceil(this.at / align) * align;
    this.room(at + size);
    this.at = at + size;
    return at;
  }
  private room(size: number): void {
    if (size <= this.bytes.length) return;
    const larger = new Uint8Array(Math.max(size, 2 * this.bytes.length));
    larger.set(this.bytes);
    this.bytes = larger;
    this.view = new DataView(larger.buffer);
  }
}

export interface FrameSample {
  stream: string;
  sequence: bigint;
  number: bigint;
  captureNs: bigint; // UTC
  publishNs: bigint;
  data: Uint8Array; // codec/FORMAT.md
}

/** A relievo::Frame. */
export function writeFrame(frame: FrameSample): Uint8Array {
  const sample = new Sample(frame.data.length + 256);
  sample.appendable(() => {
    sample.text(frame.stream);
    for (const value of [frame.sequence, frame.number, frame.captureNs, frame.publishNs]) sample.i64(value);
    sample.octets(frame.data);
  });
  return sample.finish();
}

/** A relievo::StreamInfo; null where the server did not say all of it. */
export function writeStreamInfo(info: StreamInfo): Uint8Array | null {
  const { projector, pattern, colour_matrix: colour } = info;
  const { projector_from_camera_rotation: rotation, projector_from_camera_translation: translation } = info;
  if (!projector || !pattern || !colour || !rotation || !translation) return null;
  const sample = new Sample(2048);
  const one = (of: readonly string[], name: string | undefined): void => sample.u32(Math.max(0, of.indexOf(name ?? '')));
  sample.appendable(() => {
    sample.text(info.stream);
    sample.text(info.source);
    sample.i64(BigInt(info.started_ns ?? 0));
    sample.appendable(() => {
      one(kScans, info.scan);
      sample.doubles([info.frame_rate]);
      for (const model of [info.camera, projector]) sample.appendable(() => writePinhole(sample, model));
      sample.doubles([...rotation, ...translation, ...colour]);
      one(kFieldOrders, info.field_order);
      sample.doubles([info.stereo_rms_px ?? 0, info.scale_error ?? 0]);
      sample.doubles(info.world_from_camera_rotation ?? Array<number>(9).fill(0));
      sample.doubles(info.world_from_camera_translation ?? [0, 0, 0]);
      sample.doubles([info.camera_gamma ?? 1]);
    });
    sample.appendable(() => {
      sample.u32(pattern.base);
      sample.u32(pattern.slides);
      sample.octets(Uint8Array.from(pattern.palette));
      sample.u32(pattern.sequence.length);
      for (const code of pattern.sequence) sample.u32(code);
      one(kSchemes, pattern.scheme);
    });
  });
  return sample.finish();
}

function writePinhole(sample: Sample, { width, height, fx, fy, cx, cy, distortion }: Pinhole): void {
  sample.u32(width);
  sample.u32(height);
  sample.doubles([fx, 0, cx, 0, fy, cy, 0, 0, 1]);
  sample.doubles(Array.from({ length: 5 }, (_, i) => distortion?.[i] ?? 0));
}
