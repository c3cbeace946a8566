// SPDX-License-Identifier: Apache-2.0
// Proves: what an independent writer wrote is found, by its index and without; damage is told and does no harm.
import { McapWriter, type McapWriterOptions } from '@mcap/core';
import { describe, expect, it } from 'vitest';
import { kFrameHeadBytes, readFrameHead } from '../src/cdr';
import { crc32 } from '../src/crc32';
import { openMcap, readMessage, readMessageHead, type Bytes, type McapFile, type McapMessage } from '../src/mcap';
import { Recording } from '../src/recording';
import { RemoteFile } from '../src/remoteFile';

const kChannels = ['relievo/frame', 'relievo/status'];

/** A relievo::Frame as CDR, of so many `more` bytes. */
function frameCdr(sequence: number, isKey: boolean, more = 0): Uint8Array {
  const payload = new Uint8Array(70 + sequence + more);
  payload.set([0x52, 0x4c, 0x56, 0x46, 1, isKey ? 1 : 0]);
  const out = new DataView(new ArrayBuffer(4 + 4 + 12 + 32 + 4 + payload.length));
  out.setUint8(1, 9);
  out.setUint32(4, out.byteLength - 8, true);
  out.setUint32(8, 5, true);
  for (const [i, c] of [...'face\0'].entries()) out.setUint8(12 + i, c.charCodeAt(0));
  out.setBigUint64(20, BigInt(sequence), true);
  out.setBigUint64(28, BigInt(sequence + 100), true);
  out.setBigInt64(36, 1_700_000_000_000_000_000n + BigInt(sequence) * 33_000_000n, true);
  out.setBigInt64(44, 1_700_000_000_020_000_000n + BigInt(sequence) * 33_000_000n, true);
  out.setUint32(52, payload.length, true);
  new Uint8Array(out.buffer).set(payload, 56);
  return new Uint8Array(out.buffer);
}

class Memory implements Bytes {
  private parts: Uint8Array[] = [];
  bytes = new Uint8Array(0);
  get size(): number {
    return this.bytes.length;
  }
  position = (): bigint => BigInt(this.parts.reduce((sum, p) => sum + p.length, 0));
  write = async (part: Uint8Array): Promise<void> => void this.parts.push(part.slice());
  finish(): void {
    this.bytes = new Uint8Array(Buffer.concat(this.parts));
  }
  read = async (at: number, length: number): Promise<Uint8Array> => this.bytes.slice(at, at + length);
}

async function write(frames: number[], options: Partial<McapWriterOptions> = {}, channels = kChannels, more = 0): Promise<Memory> {
  const file = new Memory();
  const writer = new McapWriter({ writable: file, chunkSize: 700, ...options });
  await writer.start({ profile: '', library: 'test' });
  const schemaId = await writer.registerSchema({ name: 'x', encoding: 'omgidl', data: new Uint8Array(0) });
  const ids = new Map<string, number>();
  for (const topic of channels) {
    ids.set(topic, await writer.registerChannel({ topic, schemaId, messageEncoding: 'cdr', metadata: new Map() }));
  }
  for (const sequence of frames) {
    const time = 1_700_000_000_000_000_000n + BigInt(sequence) * 33_000_000n;
    const message = { sequence, logTime: time, publishTime: time };
    await writer.addMessage({ channelId: ids.get(kChannels[0]!)!, ...message, data: frameCdr(sequence, sequence % 5 === 0, more) });
    await writer.addMessage({ channelId: ids.get(kChannels[1]!)!, ...message, data: new Uint8Array([1, 2, 3]) });
  }
  await writer.end();
  file.finish();
  return file;
}

const kFrames = Array.from({ length: 23 }, (_, i) => i);

/** A file as a server has it, and how much of it was asked for. */
class Server {
  asked = 0;
  broken = false; // what it gives is zeros
  constructor(private readonly file: Memory) {}
  open = (): Promise<RemoteFile> =>
    RemoteFile.open(new URL('http://server/face.mcap'), async (_, init) => {
      const [from, to] = new Headers(init.headers).get('Range')!.slice('bytes='.length).split('-').map(Number) as [number, number];
      const part = await this.file.read(from, to - from + 1);
      this.asked += part.length;
      const headers = { ETag: '"1"', 'Content-Range': `bytes ${from}-${to}/${this.file.size}` };
      return new Response(this.broken ? new Uint8Array(part.length) : new Uint8Array(part), { status: 206, headers });
    });
}

/** 20 MB in chunks of about five frames. */
const kLarge = 100_000;
const writeLarge = (frames: number[]): Promise<Memory> => write(frames, { chunkSize: 5 * kLarge }, kChannels, kLarge);
const ofChannel = ({ topics, messages }: McapFile, i: number): McapMessage[] => messages.filter((m) => topics.get(m.channel) === kChannels[i]);

describe('openMcap', () => {
  it('finds every message by the index, in order', async () => {
    const file = await write(kFrames);
    const found = await openMcap(file);
    expect(found.damage).toBeNull();
    expect([...found.topics.values()].sort()).toEqual(kChannels);
    const frames = found.messages.filter((m) => found.topics.get(m.channel) === kChannels[0]);
    expect(frames.length).toBe(kFrames.length);
    for (const [i, frame] of frames.entries()) {
      expect(frame.timeMs).toBeCloseTo(1.7e12 + i * 33, 3);
      const data = await readMessage(file, frame);
      expect(data).toEqual(frameCdr(i, i % 5 === 0));
      expect(readFrameHead(data)).toMatchObject({ stream: 'face', sequence: i, number: i + 100, isKey: i % 5 === 0, length: 70 + i });
      expect(readFrameHead(await readMessageHead(file, frame, kFrameHeadBytes)).sequence).toBe(i);
    }
  });

  it('reads of a large file of a server what is in it, and no more before it is wanted', async () => {
    const file = await writeLarge(Array.from({ length: 200 }, (_, i) => i));
    const server = new Server(file);
    const far = await server.open();
    const found = await openMcap(far);
    expect(server.asked).toBeLessThan(file.size / 10);
    const frames = ofChannel(found, 0);
    for (const channel of [0, 1]) {
      const times = ofChannel(found, channel).map((m) => m.timeMs);
      expect(times.length).toBe(200);
      expect([...times].sort((a, b) => a - b)).toEqual(times);
      for (const [i, timeMs] of times.entries()) expect(Math.abs(timeMs - 1.7e12 - i * 33)).toBeLessThan(5 * 33);
    }
    // In any order, several of one part at once.
    const order = [150, 151, 199, 0, 152];
    const read = await Promise.all(order.map((i) => readMessage(far, frames[i]!)));
    for (const [k, i] of order.entries()) expect(read[k]).toEqual(frameCdr(i, i % 5 === 0, kLarge));
    expect(readFrameHead(await readMessageHead(far, frames[42]!, kFrameHeadBytes, true)).sequence).toBe(42);
    expect(server.asked).toBeLessThan(file.size / 4);
  });

  it('reads the places of all messages of such a file where chunks overlap', async () => {
    const file = await writeLarge(Array.from({ length: 200 }, (_, i) => (i % 2 === 0 ? i : 199 - i)));
    const far = await openMcap(await new Server(file).open());
    expect(far.messages).toEqual((await openMcap(file)).messages);
  });

  it('says that the index of a part of it is damaged, and tries again', async () => {
    const server = new Server(await writeLarge(Array.from({ length: 200 }, (_, i) => i)));
    const far = await server.open();
    const frame = ofChannel(await openMcap(far), 0)[100]!;
    server.broken = true;
    await expect(readMessageHead(far, frame, kFrameHeadBytes, true)).rejects.toThrow('damaged');
    server.broken = false;
    expect(await readMessage(far, frame)).toEqual(frameCdr(100, true, kLarge));
  });

  it('goes through a file that was cut short, whole chunks only', async () => {
    const file = await write(kFrames);
    const all = (await openMcap(file)).messages.length;
    let last = 0;
    for (const share of [0.3, 0.5, 0.8]) {
      const cut = new Memory();
      cut.bytes = file.bytes.slice(0, Math.floor(file.size * share));
      const { messages, damage } = await openMcap(cut);
      expect(damage).toMatch(/cut short/);
      expect(messages.length).toBeGreaterThan(last);
      expect(messages.length).toBeLessThan(all);
      for (const m of messages) expect((await readMessage(cut, m)).length).toBeGreaterThan(0);
      last = messages.length;
    }
  });

  it('leaves out a chunk whose bytes have changed, where it has to go through', async () => {
    const file = await write(kFrames);
    const sound = (await openMcap(file)).messages;
    const cut = new Memory();
    cut.bytes = file.bytes.slice(0, file.size - 20);
    cut.bytes[sound[4]!.at + 40]! ^= 1;
    const { messages, damage } = await openMcap(cut);
    expect(damage).toMatch(/damaged/);
    expect(messages.length).toBeLessThan(sound.length);
    expect(messages.length).toBeGreaterThan(0);
  });

  const joined = (...parts: Uint8Array[]): Memory => {
    const file = new Memory();
    file.bytes = new Uint8Array(Buffer.concat(parts));
    return file;
  };

  it('reads recordings that were joined, ids by themselves', async () => {
    const [first, second] = [await write(kFrames.slice(0, 9)), await write(kFrames.slice(9), {}, ['relievo/other', ...kChannels])];
    const file = joined(first.bytes, second.bytes, (await write(kFrames.slice(2, 4))).bytes);
    const { topics, messages, damage } = await openMcap(file);
    expect(damage).toBeNull();
    const frames = messages.filter((m) => topics.get(m.channel) === kChannels[0]);
    expect(new Set(frames.map((m) => m.channel)).size).toBe(1);
    const read = await Promise.all(frames.map(async (m) => readFrameHead(await readMessage(file, m)).sequence));
    expect(read).toEqual([0, 1, 2, 2, 3, 3, ...kFrames.slice(4)]);
    expect((await Recording.open(file)).count).toBe(kFrames.length + 2);
  });

  it('reads what follows a recording that was cut short', async () => {
    const [first, second] = [await write(kFrames.slice(0, 9)), await write(kFrames.slice(9))];
    for (const share of [0.31, 0.5, 0.77]) {
      const { topics, messages, damage } = await openMcap(joined(first.bytes.slice(0, first.size * share), second.bytes));
      expect(damage).toMatch(/cut short|left out/);
      const frames = messages.filter((m) => topics.get(m.channel) === kChannels[0]);
      expect(frames.length).toBeGreaterThan(kFrames.length - 9);
      expect(frames.length).toBeLessThan(kFrames.length);
    }
    const { damage } = await openMcap(joined(first.bytes, second.bytes.slice(0, second.size / 2)));
    expect(damage).toMatch(/cut short/);
  });

  it('refuses what it cannot read, and says why', async () => {
    const none = new Memory();
    none.bytes = new TextEncoder().encode('no recording at all, but long enough to look at');
    await expect(openMcap(none)).rejects.toThrow(/no MCAP file/);
    const compressed = await write(kFrames, {
      compressChunk: (bytes: Uint8Array) => ({ compression: 'zstd', compressedData: bytes }),
    });
    await expect(openMcap(compressed)).rejects.toThrow(/compressed \(zstd\)/);
  });

  it('survives any bytes', async () => {
    const file = await write(kFrames.slice(0, 6));
    let seed = 7;
    const random = (below: number): number => (seed = (seed * 48271) % 2147483647) % below;
    for (let round = 0; round < 300; ++round) {
      const broken = new Memory();
      broken.bytes = file.bytes.slice(0, random(4) === 0 ? random(file.size) : file.size);
      for (let i = 0; i < 1 + random(4) && broken.size > 0; ++i) broken.bytes[random(broken.size)] = random(256);
      try {
        for (const m of (await openMcap(broken)).messages) await readMessage(broken, m).then(readFrameHead);
      } catch (error) {
        expect(error).toBeInstanceOf(Error);
      }
    }
  });
});

describe('Recording', () => {
  it('knows its key frames and what is missing', async () => {
    const recording = await Recording.open(await write(kFrames.filter((i) => i < 7 || i > 9)));
    await recording.readHeads(() => true);
    expect(recording.count).toBe(20);
    expect(await recording.keyBefore(6)).toBe(5);
    expect(await recording.keyBefore(7)).toBe(7); // number 10
    expect(recording.gapBefore(7)).toBe(3);
    expect(recording.gapBefore(8)).toBe(0);
    expect(recording.times[7]! - recording.times[6]!).toBeCloseTo(4 * 33, 3);
  });

  it('grows behind what is there, of which nothing is read again', async () => {
    const of = (count: number): Promise<Memory> => write(kFrames.slice(0, count), { chunkSize: 1 }); // a message a chunk
    const [some, more] = [await of(9), await of(14)];
    let [now, from] = [some.bytes, Infinity]; // what the server has, and the first byte read
    const file: Bytes = {
      get size() {
        return some.size;
      },
      read: (at, length) => {
        from = Math.min(from, at);
        return some.read(at, length);
      },
      grow: async () => void (some.bytes = now),
    };
    const recording = await Recording.open(file);
    await recording.readHeads(() => true);
    expect(await recording.grow()).toBe(false);
    const { end, times } = recording;
    expect(Buffer.compare(some.bytes.slice(0, end!), more.bytes.slice(0, end!))).toBe(0);

    now = more.bytes;
    from = Infinity;
    expect(await recording.grow()).toBe(true);
    expect(from).toBeGreaterThanOrEqual(end!);
    expect(recording.count).toBe(14);
    expect(recording.times.slice(0, 9)).toEqual(times);
    expect(recording.times[13]! - times[0]!).toBeCloseTo(13 * 33, 3);
    expect((await recording.head(13)).sequence).toBe(13);
    expect(recording.isKey(5)).toBe(true);
    expect(recording.end).toBeGreaterThan(end!);
    expect(await recording.grow()).toBe(false);
    expect(recording.count).toBe(14);
  });

  it('reads of a long index what was added to it alone', async () => {
    const of = (count: number): Promise<Memory> => write(kFrames.concat(new Array<number>(count).fill(22)), { chunkSize: 1 });
    const [some, more] = [await of(4000), await of(4002)];
    const file = new Memory();
    file.bytes = some.bytes;
    const server = new Server(file);
    const recording = await Recording.open(await server.open());
    expect(file.size - recording.end!).toBeGreaterThan(650_000);

    file.bytes = more.bytes;
    server.asked = 0;
    expect(await recording.grow()).toBe(true);
    expect(recording.count).toBe(23 + 4002);
    expect(recording.times.length).toBe(recording.count);
    // With the message indexes of the new chunks, which are read with what is around them.
    expect(server.asked).toBeLessThan(600_000);
  });

  it('grows also by an index that is not the one of before with more at its end', async () => {
    const of = (count: number, options = {}): Promise<Memory> => write(kFrames.slice(0, count), { chunkSize: 1, ...options });
    const grown = async (now: Uint8Array<ArrayBuffer>): Promise<Recording> => {
      const file: Memory & { grow?: () => Promise<void> } = await of(9);
      file.grow = async () => void (file.bytes = now);
      const recording = await Recording.open(file);
      await recording.grow();
      return recording;
    };
    expect((await grown((await of(14, { useSummaryOffsets: false })).bytes)).count).toBe(14);
    const { bytes } = await of(14);
    let seed = 5;
    const random = (below: number): number => (seed = (seed * 48271) % 2147483647) % below;
    for (let round = 0; round < 200; ++round) {
      const broken = bytes.slice();
      broken[broken.length - 1 - random(1500)] = random(256);
      await grown(broken).catch((error: unknown) => expect(error).toBeInstanceOf(Error));
    }
  });

  it('asks for no frames but those that are shown where there are very many', async () => {
    const server = new Server(await write(Array.from({ length: 20_001 }, (_, i) => i % 100), { chunkSize: 10_000 }));
    const recording = await Recording.open(await server.open());
    const asked = server.asked;
    let told = 0;
    await recording.readHeads(() => ++told > 0);
    expect([told, server.asked]).toEqual([1, asked]);
    await recording.read(3);
    expect(recording.isKey(3)).not.toBeNull();
    expect(recording.isKey(4)).toBeNull();
  });

  it('of this device does not grow', async () => {
    const recording = await Recording.open(await write(kFrames));
    expect(recording.end).toBeNull();
    expect(await recording.grow()).toBe(false);
  });

  it('without a frame is none', async () => {
    await expect(Recording.open(await write([]))).rejects.toThrow(/no frame/);
  });
});

describe('crc32', () => {
  it('is the usual one', () => expect(crc32(new TextEncoder().encode('123456789'))).toBe(0xcbf43926));
});
