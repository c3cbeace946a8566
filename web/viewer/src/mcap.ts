// SPDX-License-Identifier: Apache-2.0
// Where the messages of an MCAP file (https://mcap.dev/spec) are: by its index, or by going through it where there is
// none, as after a crash. Only uncompressed chunks, which is what recordings have (codec/FORMAT.md). Any input.
import { crc32 } from './crc32';
import { FileError } from './fileError';
import type { Sample } from './frameStore';
import { text } from './strings';

/** A file, or anything like it. `read` gives fewer bytes only at the end. */
export interface Bytes {
  readonly size: number;
  /** read() here brings much around it along; for a little in many places there is readLittle(). */
  isRemote?: boolean;
  read(at: number, length: number): Promise<Uint8Array>;
  /** Only this, where it is not there already. */
  readLittle?(at: number, length: number): Promise<Uint8Array>;
  /** What was asked for and has not come is not waited for any more: it is asked for anew. */
  giveUp?(): void;
  /** It may have changed from `end` on, where it then is read anew; `size` says how much there is. */
  grow?(end: number): Promise<void>;
}

export const bytesOf = (blob: Blob): Bytes => ({
  size: blob.size,
  read: async (at, length) => new Uint8Array(await blob.slice(at, at + length).arrayBuffer()),
});

export interface McapMessage {
  channel: number;
  timeMs: number; // log time, UTC; where there is a `part`, as if those of its chunk were evenly apart
  at: number; // of its record in the file; where there is a `part`, not before that was read
  part?: Part;
}

export interface McapFile {
  topics: Map<number, string>; // of the channels
  messages: McapMessage[]; // by time
  /** Of its chunks, where more may follow while it is written; null: there is no index. */
  end: number | null;
  /** Bytes that its index takes to name its chunks; those of more follow. */
  listed: number;
  /** Why only the beginning is there; null: all is. */
  damage: string | null;
}

const kMagic = [0x89, 0x4d, 0x43, 0x41, 0x50, 0x30, 0x0d, 0x0a];
const kRecordHead = 9;
const kFooterBytes = kRecordHead + 20;
const kDataEndBytes = kRecordHead + 4; // between the chunks and the index
const kMessageHead = 22; // of a message's content, before its data
const kMaxChunk = 2 ** 30;
const kTogether = 16; // reads at a time
const kWindow = 2 ** 20; // read at once while looking for a recording
const kFarBytes = 2 ** 24; // of a remote file, up to which all of it may be read to open it
const kLongestChunkMs = 1000; // of those whose messages are taken for evenly apart; ours last half of it
const kLastBytes = 4096; // of a file that grew, in which most often all is that is new of its index
const kMostOffsets = 4096; // bytes of the places of the summary's groups
const kOp = { header: 1, footer: 2, channel: 4, message: 5, chunk: 6, messageIndex: 7, chunkIndex: 8, summaryOffset: 14, dataEnd: 15 };

/** Throws a FileError where the file is none of ours. */
export async function openMcap(file: Bytes): Promise<McapFile> {
  const start = await file.read(0, kMagic.length);
  if (!isMagic(start)) throw new FileError(text.file.noMcap);
  const indexed = await readIndexed(file);
  return inOrder(indexed ?? (await walk(file)));
}

/**
 * What was added to a file that has grown, behind `end` and what its index `listed` then. Of the index that it has now
 * no more is read than that, where it begins as it was.
 */
export async function openAdded(file: Bytes, end: number, listed: number): Promise<McapFile> {
  const found = (await readAdded(file, end, listed).catch(notAddedTo)) ?? (await readIndexed(file, end));
  if (found === null) throw new Error('its index is damaged');
  return inOrder(found);
}

function inOrder(found: McapFile): McapFile {
  found.messages.sort((a, b) => a.timeMs - b.timeMs);
  return found;
}

/** A message, whole. */
export async function readSample(file: Bytes, message: McapMessage): Promise<Sample> {
  await message.part?.read(file);
  const { at } = message;
  const head = await file.read(at, kRecordHead);
  const length = lengthOf(head);
  if (head[0] !== kOp.message || !(length >= kMessageHead && length <= kMaxChunk)) throw new Error('a message is damaged');
  const content = await file.read(at + kRecordHead, length);
  if (content.length !== length) throw new Error('a message is cut short');
  const view = viewOf(content);
  return {
    sequence: view.getUint32(2, true),
    logNs: view.getBigUint64(6, true),
    publishNs: view.getBigUint64(14, true),
    data: content.subarray(kMessageHead),
  };
}

/** Its data alone. */
export async function readMessage(file: Bytes, message: McapMessage): Promise<Uint8Array> {
  return (await readSample(file, message)).data;
}

/** The first bytes of a message's data; `little`: and nothing around them. */
export async function readMessageHead(file: Bytes, message: McapMessage, length: number, little = false): Promise<Uint8Array> {
  await message.part?.read(file, little);
  const from = message.at + kRecordHead + kMessageHead;
  return little && file.readLittle !== undefined ? file.readLittle(from, length) : file.read(from, length);
}

const viewOf = (bytes: Uint8Array): DataView => new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
const u64 = (view: DataView, at: number): number => Number(view.getBigUint64(at, true));
const timeMs = (view: DataView, at: number): number => Number(view.getBigUint64(at, true) / 1000n) / 1000;
const lengthOf = (head: Uint8Array): number => (head.length < kRecordHead ? -1 : u64(viewOf(head), 1));

interface Record {
  op: number;
  content: Uint8Array;
  at: number; // of the record in `bytes`
}

/** Whole records one behind the other; what is cut short at the end is left out. */
function* records(bytes: Uint8Array): Generator<Record> {
  for (let at = 0; at + kRecordHead <= bytes.length; ) {
    const length = u64(viewOf(bytes), at + 1);
    const end = at + kRecordHead + length;
    if (!(end <= bytes.length)) return;
    yield { op: bytes[at]!, content: bytes.subarray(at + kRecordHead, end), at };
    at = end;
  }
}

interface Channel {
  id: number;
  topic: string;
}

/** Null where it makes no sense. */
function readChannel(content: Uint8Array): Channel | null {
  if (content.length < 8) return null;
  const view = viewOf(content);
  const end = 8 + view.getUint32(4, true);
  return end > content.length ? null : { id: view.getUint16(0, true), topic: new TextDecoder().decode(content.subarray(8, end)) };
}

/** The messages of chunks from `from` on. Null where there is no index, or its CRC is wrong. */
async function readIndexed(file: Bytes, from = 0): Promise<McapFile | null> {
  const tail = await file.read(Math.max(0, file.size - kFooterBytes - kMagic.length), kFooterBytes + kMagic.length);
  if (tail.length < kFooterBytes + kMagic.length || tail[0] !== kOp.footer) return null;
  if (!isMagic(tail.subarray(kFooterBytes))) return null;
  const view = viewOf(tail);
  const summaryAt = u64(view, kRecordHead);
  const crc = view.getUint32(kRecordHead + 16, true);
  const summaryEnd = file.size - kFooterBytes - kMagic.length;
  if (summaryAt === 0 || !(summaryAt < summaryEnd)) return null;
  const summary = await file.read(summaryAt, summaryEnd - summaryAt + kFooterBytes - 4);
  if (crc !== 0 && crc32(summary) !== crc) return null;
  const topics = new Map<number, string>();
  const chunks: Chunk[] = [];
  let listed = 0;
  try {
    for (const { op, content } of records(summary)) {
      if (op === kOp.channel) {
        const channel = readChannel(content);
        if (channel === null) return null;
        topics.set(channel.id, channel.topic);
      }
      if (op !== kOp.chunkIndex) continue;
      listed += kRecordHead + content.length;
      const chunk = readChunkIndex(content);
      if (chunk.at >= from) chunks.push(chunk);
    }
    const messages = await messagesOf(file, chunks);
    return { topics, messages, end: summaryAt - kDataEndBytes, listed, damage: null };
  } catch (error) {
    if (error instanceof FileError) throw error;
    return null;
  }
}

const messagesOf = async (file: Bytes, chunks: Chunk[]): Promise<McapMessage[]> =>
  (isFar(file) ? await readEnds(file, chunks) : null) ?? readIndices(file, chunks);

/** Null where it is not the index of before with more at its end. */
async function readAdded(file: Bytes, from: number, listed: number): Promise<McapFile | null> {
  const lastAt = Math.max(from, file.size - kLastBytes);
  const last = await readOnly(file, lastAt, file.size - lastAt);
  const read = (at: number, length: number): Promise<Uint8Array> | Uint8Array =>
    at >= lastAt ? last.subarray(at - lastAt, at - lastAt + length) : readOnly(file, at, length);
  const summaryEnd = file.size - kFooterBytes - kMagic.length;
  const tail = await read(summaryEnd, kFooterBytes + kMagic.length);
  if (tail[0] !== kOp.footer || !isMagic(tail.subarray(kFooterBytes))) return null;
  const [summaryAt, offsetsAt] = [u64(viewOf(tail), kRecordHead), u64(viewOf(tail), kRecordHead + 8)];
  if (!(summaryAt > from && offsetsAt > summaryAt && offsetsAt >= summaryEnd - kMostOffsets)) return null;
  const groups = new Map<number, { at: number; bytes: number }>();
  for (const { op, content } of records(await read(offsetsAt, summaryEnd - offsetsAt))) {
    if (op !== kOp.summaryOffset) return null;
    groups.set(content[0]!, { at: u64(viewOf(content), 1), bytes: u64(viewOf(content), 9) });
  }
  const [channels, indices] = [groups.get(kOp.channel), groups.get(kOp.chunkIndex)];
  if (channels === undefined || indices === undefined || !(listed > 0 && indices.bytes >= listed)) return null;

  const topics = new Map<number, string>();
  for (const { op, content } of records(await read(channels.at, channels.bytes))) {
    const channel = op === kOp.channel ? readChannel(content) : null;
    if (channel === null) return null;
    topics.set(channel.id, channel.topic);
  }
  const chunks: Chunk[] = [];
  let bytes = listed;
  for (const { op, content } of records(await read(indices.at + listed, indices.bytes - listed))) {
    const chunk = op === kOp.chunkIndex ? readChunkIndex(content) : null;
    if (chunk === null || !(chunk.at >= from && chunk.indexAt + chunk.indexBytes <= summaryAt)) return null;
    chunks.push(chunk);
    bytes += kRecordHead + content.length;
  }
  if (bytes !== indices.bytes) return null;
  return { topics, messages: await messagesOf(file, chunks), end: summaryAt - kDataEndBytes, listed: bytes, damage: null };
}

/** What makes no sense is looked at as a whole; whether the network is there is not asked twice. */
function notAddedTo(error: unknown): null {
  if (error instanceof RangeError) return null;
  throw error;
}

const readOnly = (file: Bytes, at: number, length: number): Promise<Uint8Array> =>
  file.readLittle === undefined ? file.read(at, length) : file.readLittle(at, length);

interface Chunk {
  startMs: number; // of its messages
  endMs: number;
  at: number;
  recordsAt: number;
  indexAt: number; // of its message indexes, one a channel,
  indexBytes: number;
  indices: { channel: number; at: number }[]; // and of each
}

function readChunkIndex(content: Uint8Array): Chunk {
  const view = viewOf(content);
  const [at, length] = [u64(view, 16), u64(view, 24)];
  const offsets = view.getUint32(32, true); // bytes of the map
  const indices = Array.from({ length: Math.floor(offsets / 10) }, (_, i) => ({
    channel: view.getUint16(36 + 10 * i, true),
    at: u64(view, 38 + 10 * i),
  }));
  const indexBytes = u64(view, 36 + offsets);
  checkCompression(content, 44 + offsets);
  const [startMs, endMs] = [timeMs(view, 0), timeMs(view, 8)];
  return { startMs, endMs, at, recordsAt: at + kRecordHead + kChunkHead, indexAt: at + length, indexBytes, indices };
}

async function readIndices(file: Bytes, chunks: Chunk[]): Promise<McapMessage[]> {
  const messages: McapMessage[] = [];
  for (let i = 0; i < chunks.length; i += kTogether) {
    const some = chunks.slice(i, i + kTogether);
    const indices = await Promise.all(some.map((chunk) => file.read(chunk.indexAt, chunk.indexBytes)));
    for (const [j, index] of indices.entries()) addIndexed(index, some[j]!.recordsAt, file.size, messages);
  }
  return messages;
}

/** Of which not everything is read to know what is in it: message indexes lie all over it. */
const isFar = (file: Bytes): boolean => file.isRemote === true && file.size > kFarBytes;

/**
 * The messages by the chunks' own index alone, which says how many there are of each channel; those of the first and
 * the last chunk as they are. Null where that does not do: chunks that overlap, or last so long that a guess is none.
 */
async function readEnds(file: Bytes, chunks: Chunk[]): Promise<McapMessage[] | null> {
  const ordered = [...chunks].sort((a, b) => a.startMs - b.startMs);
  const [first, last] = [ordered[0], ordered[ordered.length - 1]];
  if (first === undefined || first === last) return null;
  for (const [i, chunk] of ordered.entries()) {
    if (!(chunk.endMs - chunk.startMs <= kLongestChunkMs) || (i > 0 && chunk.startMs < ordered[i - 1]!.endMs)) return null;
  }
  const guessed: McapMessage[] = [];
  for (const chunk of ordered.slice(1, -1)) {
    const messages = guess(chunk);
    if (messages === null) return null;
    for (const message of messages) guessed.push(message);
  }
  const ends = await readIndices(file, [first, last!]);
  return [...ends, ...guessed];
}

/** Null where its message indexes do not lie one behind the other. */
function guess(chunk: Chunk): McapMessage[] | null {
  const { startMs, endMs, indexAt, indexBytes } = chunk;
  const indices = [...chunk.indices].sort((a, b) => a.at - b.at);
  const messages: McapMessage[] = [];
  const part = new Part(chunk, messages);
  let at = indexAt;
  for (const [i, index] of indices.entries()) {
    const end = indices[i + 1]?.at ?? indexAt + indexBytes;
    const count = (end - at - kRecordHead - kMessageIndexHead) / kMessageIndexEntry;
    if (index.at !== at || !Number.isInteger(count) || count < 0) return null;
    const step = (endMs - startMs) / Math.max(1, count - 1);
    for (let j = 0; j < count; ++j) messages.push({ channel: index.channel, timeMs: startMs + j * step, at: -1, part });
    at = end;
  }
  return at === indexAt + indexBytes ? messages : null;
}

const kMessageIndexHead = 6; // of a message index's content: channel, bytes of its entries
const kMessageIndexEntry = 16;

/** A chunk of which it is not known yet where in it its messages are. */
export class Part {
  private reading: Promise<void> | null = null;

  /** `messages` are given their places. */
  constructor(
    private readonly chunk: { recordsAt: number; indexAt: number; indexBytes: number },
    private readonly messages: readonly McapMessage[],
  ) {}

  /** `little`: nothing around its index is wanted. */
  read(file: Bytes, little = false): Promise<void> {
    this.reading ??= this.readOnce(file, little).catch((error: unknown) => {
      this.reading = null;
      throw error;
    });
    return this.reading;
  }

  private async readOnce(file: Bytes, little: boolean): Promise<void> {
    const { recordsAt, indexAt, indexBytes } = this.chunk;
    const index =
      little && file.readLittle !== undefined ? await file.readLittle(indexAt, indexBytes) : await file.read(indexAt, indexBytes);
    const found: McapMessage[] = [];
    addIndexed(index, recordsAt, file.size, found);
    found.sort((a, b) => a.timeMs - b.timeMs || a.at - b.at);
    const places = new Map<number, number[]>();
    for (const { channel, at } of found) {
      const of = places.get(channel);
      if (of === undefined) places.set(channel, [at]);
      else of.push(at);
    }
    const next = new Map<number, number>(); // of each channel's
    for (const message of this.messages) {
      const i = next.get(message.channel) ?? 0;
      const at = places.get(message.channel)?.[i];
      if (at === undefined) throw new Error('the index of a part of it is damaged');
      next.set(message.channel, i + 1);
      message.at = at;
    }
  }
}

const kChunkHead = 40; // of an uncompressed chunk's content, before its records

function checkCompression(content: Uint8Array, at: number): void {
  const length = viewOf(content).getUint32(at, true);
  if (length === 0) return;
  const name = new TextDecoder().decode(content.subarray(at + 4, at + 4 + Math.min(length, 16)));
  throw new FileError(text.file.compressed(name));
}

function addIndexed(index: Uint8Array, recordsAt: number, size: number, messages: McapMessage[]): void {
  for (const { op, content } of records(index)) {
    if (op !== kOp.messageIndex) continue;
    const view = viewOf(content);
    const channel = view.getUint16(0, true);
    const bytes = view.getUint32(2, true);
    for (let at = 6; at + 16 <= Math.min(6 + bytes, content.length); at += 16) {
      const message = { channel, timeMs: timeMs(view, at), at: recordsAt + u64(view, at + 8) };
      if (message.at < size) messages.push(message);
    }
  }
}

/** What is read of a file without its index. */
class Walked {
  readonly found: McapFile = { topics: new Map(), messages: [], end: null, listed: 0, damage: null };
  private readonly channels = new Map<string, number>(); // of each channel's description
  private ids = new Map<number, number>(); // of this recording's channels
  private parts = 1;

  /** Another recording follows in the same file; its ids are its own, but a channel of the same description goes on. */
  next(): void {
    this.ids = new Map();
    ++this.parts;
  }
  get joined(): boolean {
    return this.parts > 1;
  }

  /** One that makes no sense is left out, and its messages have no topic. */
  addChannel(content: Uint8Array): void {
    const channel = readChannel(content);
    if (channel === null) return;
    const told = new TextDecoder('latin1').decode(content.subarray(4)); // all but its numbers
    const id = this.channels.get(told) ?? kIds * (this.parts - 1) + channel.id;
    this.channels.set(told, id);
    this.ids.set(channel.id, id);
    this.found.topics.set(id, channel.topic);
  }

  /** False where its CRC is wrong. */
  addChunk(content: Uint8Array, at: number): boolean {
    if (content.length < kChunkHead) return false;
    checkCompression(content, 28);
    const crc = viewOf(content).getUint32(24, true);
    const inner = content.subarray(kChunkHead);
    if (crc !== 0 && crc32(inner) !== crc) return false;
    for (const record of records(inner)) {
      if (record.op === kOp.channel) this.addChannel(record.content);
      if (record.op !== kOp.message || record.content.length < kMessageHead) continue;
      const view = viewOf(record.content);
      const own = view.getUint16(0, true);
      this.found.messages.push({ channel: this.ids.get(own) ?? own, timeMs: timeMs(view, 6), at: at + kChunkHead + record.at });
    }
    return true;
  }
}

const kIds = 2 ** 16; // that a recording's channels can have

/** As far as it is sound, and through recordings that were joined; half a chunk is not read, since nothing vouches for it. */
async function walk(file: Bytes): Promise<McapFile> {
  const walked = new Walked();
  const { found } = walked;
  let whole = true; // all before
  let ended = false; // the recording that is read, by its footer
  for (let at = kMagic.length; at < file.size; ) {
    if (await beginsAt(file, at)) {
      walked.next();
      whole &&= ended;
      ended = false;
      at += kMagic.length;
      continue;
    }
    const record = await recordAt(file, at);
    if (record === null) {
      at = await nextBeginning(file, at + 1);
      continue;
    }
    const { op, length, end } = record;
    let sound = await goesOnAt(file, end);
    if (op === kOp.chunk && length <= kMaxChunk) {
      const content = await file.read(at + kRecordHead, length);
      sound = walked.addChunk(content, at + kRecordHead);
      if (!sound) found.damage = 'a part of it is damaged and left out';
    } else if (op === kOp.channel && sound) {
      walked.addChannel(await file.read(at + kRecordHead, length));
    }
    // Where it was cut short, what follows may have begun within it.
    at = sound ? end : Math.min(end, await nextBeginning(file, at + 1, end));
    if (op !== kOp.footer || !sound) continue;
    ended = isMagic(await file.read(at, kMagic.length));
    if (ended) at += kMagic.length;
  }
  if (!walked.joined) found.damage ??= 'it has no index: it was cut short';
  else if (!whole || !ended) found.damage ??= 'a part of it was cut short';
  return found;
}

const isMagic = (bytes: Uint8Array): boolean => kMagic.every((b, i) => bytes[i] === b);

/** Null where the file is too short for it, or there is none, as where a power loss left zeros. */
async function recordAt(file: Bytes, at: number): Promise<{ op: number; length: number; end: number } | null> {
  const head = await file.read(at, kRecordHead);
  const length = lengthOf(head);
  const end = at + kRecordHead + length;
  return length < 0 || head[0] === 0 || end > file.size ? null : { op: head[0]!, length, end };
}

/** Whether a record or a recording could begin there, or the file ends. */
async function goesOnAt(file: Bytes, at: number): Promise<boolean> {
  const next = await recordAt(file, at);
  return at === file.size || (next !== null && next.op <= kOp.dataEnd) || isMagic(await file.read(at, kMagic.length));
}

/** Whether a recording does: a file's first bytes and a header. */
async function beginsAt(file: Bytes, at: number): Promise<boolean> {
  const bytes = await file.read(at, kMagic.length + 1);
  return isMagic(bytes) && bytes[kMagic.length] === kOp.header;
}

/** Where the next recording begins from `at` on; the file's end where none does before `end`. */
async function nextBeginning(file: Bytes, at: number, end = file.size): Promise<number> {
  for (; at < end; at += kWindow) {
    const window = await file.read(at, kWindow + kMagic.length); // so that none is missed between two
    for (let i = window.indexOf(kMagic[0]!); i >= 0 && i < kWindow; i = window.indexOf(kMagic[0]!, i + 1))
      if (isMagic(window.subarray(i)) && (await beginsAt(file, at + i))) return at + i;
  }
  return file.size;
}
