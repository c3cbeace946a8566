// SPDX-License-Identifier: Apache-2.0
// A recording, of this device or of the server: which frames it has, and each one's bytes.
import { kFrameHeadBytes, readFrameHead, readStreamInfo, type FrameHead } from './cdr';
import { FileError } from './fileError';
import { kTextureH264, parseFrame } from './frame';
import { publishMsOf, utcMsOf, type FrameStore, type Sample, type StoredFrame } from './frameStore';
import { openAdded, openMcap, readMessage, readMessageHead, readSample, type Bytes, type McapFile, type McapMessage } from './mcap';
import { Final, Unavailable } from './missing';
import { frameAt } from './playback';
import type { StreamInfo } from './protocol';
import { text } from './strings';
import { videoTextureIsKey } from './videoTexture';

const kFrameTopic = 'relievo/frame';
const kInfoTopic = 'relievo/info';
const kTogether = 64; // heads read at a time
const kApartMs = 1; // between two frames, at least: links are of whole milliseconds
const kFarHeadMs = 8; // between those of a remote file
const kFarAgainMs = 2000; // before what did not come is asked for again
const kFarSayMs = 500; // between marks drawn meanwhile
const kMostFarHeads = 20_000; // that are asked for one by one; of longer ones those have marks that were shown

export class Recording implements FrameStore {
  times: Float64Array;
  readonly startMs: number; // UTC of the first frame
  readonly first = 0;
  /** Of each frame whose head was read. */
  readonly heads: (FrameHead | undefined)[];

  private bytes: number; // of the file whose index was read last

  private constructor(
    private readonly file: Bytes,
    private readonly frames: McapMessage[],
    readonly stream: string,
    private readonly descriptions: Description[], // a server that was started again sent another
    readonly damage: string | null,
    private end_: number | null,
    private listed: number, // as McapFile has it
  ) {
    this.bytes = file.size;
    this.startMs = frames[0]!.timeMs;
    this.times = this.timesOf(frames);
    this.heads = new Array<FrameHead | undefined>(frames.length);
  }

  /** Throws with what a person should know. */
  static async open(file: Bytes): Promise<Recording> {
    const found = await openMcap(file);
    const frames = ofTopic(found, kFrameTopic);
    if (frames.length === 0) throw new FileError(found.damage === null ? text.file.noFrames : text.file.noWholeFrame);
    const one = readFrameHead(await readMessageHead(file, frames[0]!, kFrameHeadBytes)).stream;
    // A channel is a stream's; a file of several shows the first.
    const own = frames.filter((m) => m.channel === frames[0]!.channel);
    return new Recording(file, own, one, await readDescriptions(file, found, one), found.damage, found.end, found.listed);
  }

  /** Of the frames that were published then (ms UTC); null: the file does not have it. */
  infoAt(publishMs: number): StreamInfo | null {
    return this.descriptionAt(publishMs)?.info ?? null;
  }

  describing(publishMs: number): Uint8Array | null {
    return this.descriptionAt(publishMs)?.bytes ?? null;
  }

  // The last that was published before; a frame may also come before the first one.
  private descriptionAt(publishMs: number): Description | undefined {
    return this.descriptions.reduce((held, d) => (d.publishMs <= publishMs ? d : held), this.descriptions[0]);
  }

  /** Of what is there of a file that may be written on; null: it cannot grow. */
  get end(): number | null {
    return this.file.grow === undefined ? null : this.end_;
  }

  /** Looks for frames behind those that there are, which keep their places. Whether there are any. */
  async grow(): Promise<boolean> {
    const { end, file } = this;
    if (end === null) return false;
    await file.grow!(end);
    const bytes = file.size;
    if (bytes === this.bytes) return false;
    const added = await openAdded(file, end, this.listed);
    const frames = ofTopic(added, kFrameTopic).filter((m) => m.channel === this.frames[0]!.channel);
    this.descriptions.push(...(await readDescriptions(file, added, this.stream)));
    [this.bytes, this.end_, this.listed] = [bytes, added.end, added.listed];
    if (frames.length === 0) return false;
    for (const frame of frames) this.frames.push(frame);
    this.heads.length = this.frames.length;
    const times = new Float64Array(this.frames.length);
    times.set(this.times);
    times.set(this.timesOf(frames, this.times[this.times.length - 1]), this.times.length);
    this.times = times;
    return true;
  }

  // Each has a time of its own, by which it can be gone to, also where the clock stood still or was put back.
  private timesOf(frames: McapMessage[], last = -Infinity): Float64Array {
    return Float64Array.from(frames, (m) => (last = Math.max(last + kApartMs, m.timeMs - this.startMs)));
  }

  get count(): number {
    return this.frames.length;
  }

  async head(index: number): Promise<FrameHead> {
    return (this.heads[index] ??= readFrameHead(await readMessageHead(this.file, this.frames[index]!, kFrameHeadBytes)));
  }

  /** At which of `times` the last frame is that was captured by then (ms UTC); null: before the first, or behind the last. */
  async timeOf(utcMs: number): Promise<number | null> {
    const capturedMs = async (index: number): Promise<number> => utcMsOf(await this.head(index));
    let index = frameAt(this.times, utcMs - this.startMs); // it came some time after
    while (index + 1 < this.count && (await capturedMs(index + 1)) <= utcMs) ++index;
    const behindMs = utcMs - (await capturedMs(index));
    return behindMs < 0 || (index + 1 === this.count && behindMs > kApartMs) ? null : this.times[index]!;
  }

  /**
   * All heads, for marks on the time line; of a remote file one after the other, so that what plays goes
   * before, and none of one that is so long that this would keep its server busy for hours. `progress` after some of them; stops where it returns false.
   */
  async readHeads(progress: () => boolean): Promise<void> {
    if (this.file.isRemote === true) return this.readFarHeads(progress);
    for (let i = 0; i < this.count; i += kTogether) {
      const some = Array.from({ length: Math.min(kTogether, this.count - i) }, (_, j) => this.head(i + j));
      await Promise.allSettled(some); // what is damaged has no mark
      if (!progress()) return;
    }
  }

  private async readFarHeads(progress: () => boolean): Promise<void> {
    if (this.count > kMostFarHeads) return void progress();
    let saidAt = performance.now();
    for (let i = 0; i < this.count; ++i) {
      if (this.heads[i] !== undefined) continue;
      await new Promise((resolve) => setTimeout(resolve, kFarHeadMs));
      try {
        this.heads[i] ??= readFrameHead(await readMessageHead(this.file, this.frames[i]!, kFrameHeadBytes, true));
      } catch (error) {
        if (error instanceof Final) return;
        if (error instanceof Unavailable) {
          --i;
          await new Promise((resolve) => setTimeout(resolve, kFarAgainMs));
        } // else it is damaged, and has no mark
      }
      if (performance.now() - saidAt < kFarSayMs) continue;
      saidAt = performance.now();
      if (!progress()) return;
    }
    progress();
  }

  async read(index: number): Promise<StoredFrame> {
    const { head, message } = await this.readWhole(index);
    const { at, length, sequence, captureMs, publishMs } = head;
    const prefix = { bytes: at, sequence, captureMs, publishMs, sentMs: publishMs, drops: 0 };
    // DDS fills a message up to whole words; a frame has nothing behind its end.
    return { prefix, message: message.slice(0, at + length).buffer };
  }

  sample(index: number): Promise<Sample> {
    return readSample(this.file, this.frames[index]!);
  }

  giveUp(): void {
    this.file.giveUp?.();
  }

  held(): FrameStore {
    return this;
  }

  /** The message, and where in it the frame begins. */
  private async readWhole(index: number): Promise<{ head: FrameHead; message: Uint8Array }> {
    const message = await readMessage(this.file, this.frames[index]!);
    const head = readFrameHead(message);
    this.heads[index] = head;
    return { head, message };
  }

  async buildsOnFrameBefore(index: number): Promise<boolean> {
    const { head, message } = await this.readWhole(index);
    const frame = parseFrame(message.subarray(head.at, head.at + head.length));
    return frame.textureCodec === kTextureH264 && !videoTextureIsKey(frame.texture);
  }

  async keyBefore(index: number): Promise<number | null> {
    for (let i = index; i >= 0; --i) {
      if ((await this.head(i)).isKey) return i;
    }
    return null;
  }

  isKey(index: number): boolean | null {
    return this.heads[index]?.isKey ?? null;
  }

  gapBefore(index: number): number {
    const [before, here] = [this.heads[index - 1], this.heads[index]];
    if (before === undefined || here === undefined) return 0;
    return Math.max(0, here.sequence - before.sequence - 1);
  }
}

interface Description {
  publishMs: number; // UTC
  info: StreamInfo;
  bytes: Uint8Array;
}

/** Those of the stream, in the order in which they came; what is damaged is left out. */
async function readDescriptions(file: Bytes, found: McapFile, stream: string): Promise<Description[]> {
  const descriptions: Description[] = [];
  for (const message of ofTopic(found, kInfoTopic)) {
    const sample = await readSample(file, message);
    try {
      const info = readStreamInfo(sample.data);
      if (info.stream === stream) descriptions.push({ publishMs: publishMsOf(sample), info, bytes: sample.data });
    } catch {
      // what makes no sense describes nothing
    }
  }
  return descriptions;
}

function ofTopic({ topics, messages }: McapFile, topic: string): McapMessage[] {
  return messages.filter((m) => topics.get(m.channel) === topic);
}
