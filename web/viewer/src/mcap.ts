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
  /** It may have changed from `end` on, where it then is read anew; `size` says how much there is. */
  grow?(end: number): Promise<void>;
}

export const bytesOf = (blob: Blob): Bytes => ({
  size: blob.size,
  read: async (at, length) => new Uint8Array(await blob.slice(at, at + length).arrayBuffer()),
});

export interface McapMessage {
  channel: number;
  timeMs: number; // log time, UTC
  at: number; // of its record in the file
}

export interface McapFile {
  topics: Map<number, string>; // of the channels
  messages: McapMessage[]; // by time
  /** Of its chunks, where more may follow while it is written; null: there is no index. */
  end: number | null;
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
const kOp = { header: 1, footer: 2, channel: 4, message: 5, chunk: 6, messageIndex: 7, chunkIndex: 8, dataEnd: 15 };

/** Throws a FileError where the file is none of ours. */
export async function openMcap(file: Bytes): Promise<McapFile> {
  const start = await file.read(0, kMagic.length);
  if (!isMagic(start)) throw new FileError(text.file.noMcap);
  const indexed = await readIndexed(file);
  return inOrder(indexed ?? (await walk(file)));
}

/** What was added behind `end` of a file that has grown. */
export async function openAdded(file: Bytes, end: number): Promise<McapFile> {
  const found = await readIndexed(file, end);
  if (found === null) throw new Error('its index is damaged');
  return inOrder(found);
}

function inOrder(found: McapFile): McapFile {
  found.messages.sort((a, b) => a.timeMs - b.timeMs);
  return found;
}

/** A message, whole. */
export async function readSample(file: Bytes, { at }: McapMessage): Promise<Sample> {
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
export function readMessageHead(file: Bytes, { at }: McapMessage, length: number, little = false): Promise<Uint8Array> {
  const from = at + kRecordHead + kMessageHead;
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
  const chunks: { at: number; recordsAt: number; indexAt: number; indexBytes: number }[] = [];
  try {
    for (const { op, content } of records(summary)) {
      if (op === kOp.channel) {
        const channel = readChannel(content);
        if (channel === null) return null;
        topics.set(channel.id, channel.topic);
      }
      if (op !== kOp.chunkIndex) continue;
      const chunk = readChunkIndex(content);
      if (chunk.at >= from) chunks.push(chunk);
    }
    const messages: McapMessage[] = [];
    for (let i = 0; i < chunks.length; i += kTogether) {
      const some = chunks.slice(i, i + kTogether);
      const indices = await Promise.all(some.map((chunk) => file.read(chunk.indexAt, chunk.indexBytes)));
      for (const [j, index] of indices.entries()) addIndexed(index, some[j]!.recordsAt, file.size, messages);
    }
    return { topics, messages, end: summaryAt - kDataEndBytes, damage: null };
  } catch (error) {
    if (error instanceof FileError) throw error;
    return null;
  }
}

function readChunkIndex(content: Uint8Array): { at: number; recordsAt: number; indexAt: number; indexBytes: number } {
  const view = viewOf(content);
  const [at, length] = [u64(view, 16), u64(view, 24)];
  const offsets = view.getUint32(32, true); // bytes of the map
  const indexBytes = u64(view, 36 + offsets);
  checkCompression(content, 44 + offsets);
  return { at, recordsAt: at + kRecordHead + kChunkHead, indexAt: at + length, indexBytes };
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
  readonly found: McapFile = { topics: new Map(), messages: [], end: null, damage: null };
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
