// SPDX-License-Identifier: Apache-2.0
// A range of frames as one file: a recording, or a ZIP file of surfaces. Nothing is there before it is whole.
import { writeStreamInfo } from './cdrWriter';
import { Decoder } from './decoder';
import { kTextureJpeg, parseFrame } from './frame';
import { closePictures } from './frameMemory';
import { publishMsOf, type FrameStore, type StoredFrame } from './frameStore';
import type { DecodedFrame } from './messages';
import type { StreamInfo } from './protocol';
import { FrameNames, type RangeFormat } from './rangeFrames';
import { writeRecording, type DescribedSample } from './recordingFile';
import { framesBefore } from './storePlayer';
import { text } from './strings';
import { glbOf, plyOf } from './surfaceFiles';
import { kMostBytes, ZipWriter } from './zip';

export interface RangeOrder {
  store: FrameStore;
  range: readonly [number, number];
  description: Uint8Array | null; // a relievo::StreamInfo, where the store has none
  format: RangeFormat;
  /** How many of the frames are done. */
  progress(done: number): void;
  cancelled: AbortSignal;
}

export interface RangeFile {
  content: Blob;
  frames: number;
  damaged: number; // left out
}

/** Throws where it is cancelled, a frame cannot be read, or all is too much. */
export async function exportRange(order: RangeOrder): Promise<RangeFile> {
  const { store, range, format } = order;
  const [first, last] = range;
  const key = await store.keyBefore(first);
  if (key === null) throw new Error(text.take.noKey);
  const before = framesBefore(first, key, { key: -1, last: -1 }, await store.buildsOnFrameBefore(first));
  const indices = Array.from({ length: last - first + 1 }, (_, i) => first + i);
  return format === 'mcap' ? asRecording(order, [...before, ...indices]) : asSurfaces(order, before, indices);
}

async function asRecording({ store, description, progress, cancelled }: RangeOrder, indices: number[]): Promise<RangeFile> {
  let bytes = 0;
  // A server that was started again meanwhile sent another one than is there now.
  let [told, written]: [StreamInfo | null, Uint8Array | null] = [null, null];
  const descriptionOf = (index: number): Uint8Array | null => {
    const info = store.infoOf?.(index) ?? null;
    if (info !== told) [told, written] = [info, info === null ? null : writeStreamInfo(info)];
    return written ?? description;
  };
  async function* samples(): AsyncGenerator<DescribedSample> {
    for (const [done, index] of indices.entries()) {
      cancelled.throwIfAborted();
      const sample = await store.sample(index);
      bytes += sample.data.length;
      if (bytes > kMostBytes) throw new Error(text.take.tooLarge(done, kMostBytes));
      yield { sample, description: store.describing(publishMsOf(sample)) ?? descriptionOf(index) };
      progress(done + 1);
    }
  }
  const content = await writeRecording(store.stream, samples());
  return { content, frames: indices.length, damaged: 0 };
}

async function asSurfaces(order: RangeOrder, before: number[], indices: number[]): Promise<RangeFile> {
  const { store, format, progress, cancelled } = order;
  const zip = new ZipWriter();
  const names = new FrameNames();
  const frames = new Frames();
  let damaged = 0;
  let next: StoredFrame | null = null; // the frame behind, where it can be read
  try {
    for (const index of before)
      await store
        .read(index)
        .then((stored) => frames.decode(stored))
        .catch(() => null); // what builds on it tells
    for (const [done, index] of indices.entries()) {
      cancelled.throwIfAborted();
      const stored = next ?? (await store.read(index));
      next = index + 1 < store.first + store.times.length ? await store.read(index + 1).catch(() => null) : null;
      const { frame, jpeg } = await frames.decode(stored);
      if (frame === null) {
        ++damaged;
      } else {
        const content = format === 'ply' ? plyOf(frame) : await glbOf(frame, jpeg);
        closePictures(frame);
        const name = names.name(frame.number, next === null ? null : numberOf(next));
        if (!zip.add(`${name}.${format}`, content)) throw new Error(text.take.tooLarge(done, kMostBytes));
      }
      progress(done + 1);
    }
  } finally {
    frames.end();
  }
  if (damaged === indices.length) throw new Error(text.take.allDamaged);
  return { content: zip.finish(), frames: indices.length - damaged, damaged };
}

/** The camera's number of a frame; null where it is damaged. */
function numberOf({ prefix, message }: StoredFrame): number | null {
  try {
    return Number(parseFrame(new Uint8Array(message, prefix.bytes)).header.number);
  } catch {
    return null;
  }
}

/** Frames one after the other, by a decoder of its own. */
class Frames {
  private waiting: ((frame: DecodedFrame | null) => void) | null = null;
  private unusable: string | null = null;
  private readonly decoder = new Decoder({
    decoded: (frame) => this.done(frame),
    failed: () => this.done(null),
    unusable: (why) => {
      this.unusable = why;
      this.done(null);
    },
  });

  constructor() {
    this.decoder.want = { normals: false, edges: false, quality: true, rims: false };
  }

  /** `frame` null: it is damaged. `jpeg`: its texture, where it is one. */
  async decode({ prefix, message }: StoredFrame): Promise<{ frame: DecodedFrame | null; jpeg: Uint8Array | null }> {
    const jpeg = jpegOf(new Uint8Array(message, prefix.bytes));
    const frame = await new Promise<DecodedFrame | null>((resolve) => {
      this.waiting = resolve;
      this.decoder.decode(message, prefix.bytes);
    });
    if (this.unusable !== null) throw new Error(text.noDecoder(this.unusable));
    return { frame, jpeg };
  }

  end(): void {
    this.decoder.stop();
  }

  private done(frame: DecodedFrame | null): void {
    this.waiting?.(frame);
    this.waiting = null;
  }
}

function jpegOf(bytes: Uint8Array): Uint8Array | null {
  try {
    const { textureCodec, texture } = parseFrame(bytes);
    return textureCodec === kTextureJpeg ? texture.slice() : null;
  } catch {
    return null; // the decoder tells what is wrong with it
  }
}
