// SPDX-License-Identifier: Apache-2.0
// Whether a PLY file has all that its header announces: three's loader believes the header. Pure; any input.
import { FileError } from './fileError';
import { text } from './strings';

const kMostHeaderBytes = 2 ** 20;
const kSpace = 0x20; // and control characters below it end a word

type Read = (view: DataView, at: number, little: boolean) => number;
const kTypes: readonly (readonly [names: readonly string[], bytes: number, read: Read])[] = [
  [['char', 'int8'], 1, (v, at) => v.getInt8(at)],
  [['uchar', 'uint8'], 1, (v, at) => v.getUint8(at)],
  [['short', 'int16'], 2, (v, at, little) => v.getInt16(at, little)],
  [['ushort', 'uint16'], 2, (v, at, little) => v.getUint16(at, little)],
  [['int', 'int32'], 4, (v, at, little) => v.getInt32(at, little)],
  [['uint', 'uint32'], 4, (v, at, little) => v.getUint32(at, little)],
  [['float', 'float32'], 4, (v, at, little) => v.getFloat32(at, little)],
  [['double', 'float64'], 8, (v, at, little) => v.getFloat64(at, little)],
];

interface Type {
  bytes: number;
  read: Read;
}

interface Property {
  count: Type | null; // of a list
  item: Type;
}

interface Element {
  rows: number;
  properties: Property[];
}

interface Header {
  format: string;
  elements: Element[];
  end: number; // where what it announces begins
}

/** Throws a FileError where it is none, damaged, or ends too early. */
export function checkPly(bytes: Uint8Array): void {
  const { format, elements, end } = readHeader(bytes);
  const body = bytes.subarray(end);
  const skip = format === 'ascii' ? wordsOf(body) : valuesOf(body, format === 'binary_little_endian');
  for (const { rows, properties } of elements) {
    // Also where a row takes no room.
    if (rows > body.length) throw new FileError(text.file.cutShort);
    if (properties.length > 0 && !skip(rows, properties)) throw new FileError(text.file.cutShort);
  }
}

function readHeader(bytes: Uint8Array): Header {
  const start = new TextDecoder('latin1').decode(bytes.subarray(0, kMostHeaderBytes));
  if (!/^ply\s*($|[\r\n])/.test(start)) throw new FileError(text.file.noPly);
  const end = /[\r\n]end_header(\r\n|\r|\n)/.exec(start);
  if (end === null) throw new FileError(text.file.cutShort);
  const elements: Element[] = [];
  let format = '';
  for (const line of start.slice(0, end.index).split(/[\r\n]+/)) {
    const [what, ...words] = line.trim().split(/\s+/);
    if (what === 'format') format = words[0] ?? '';
    if (what === 'element') elements.push({ rows: rowsOf(words[1]), properties: [] });
    if (what === 'property') (elements.at(-1) ?? fail()).properties.push(propertyOf(words));
  }
  if (!['ascii', 'binary_little_endian', 'binary_big_endian'].includes(format)) fail();
  return { format, elements, end: end.index + end[0].length };
}

const rowsOf = (word: string | undefined): number => (/^\d+$/.test(word ?? '') ? Number(word) : fail());

function propertyOf([type, count, item]: string[]): Property {
  return type === 'list' ? { count: typeOf(count), item: typeOf(item) } : { count: null, item: typeOf(type) };
}

function typeOf(name: string | undefined): Type {
  const [, bytes, read] = kTypes.find(([names]) => names.includes(name ?? '')) ?? fail();
  return { bytes, read };
}

function fail(): never {
  throw new FileError(text.file.damaged);
}

/** Goes over so many rows from where it stands; false: the file ends before. */
type Skip = (rows: number, properties: readonly Property[]) => boolean;

function valuesOf(body: Uint8Array, little: boolean): Skip {
  const view = new DataView(body.buffer, body.byteOffset, body.length);
  let at = 0;
  return (rows, properties) => {
    if (properties.every(({ count }) => count === null)) {
      at += rows * properties.reduce((sum, { item }) => sum + item.bytes, 0);
      return at <= view.byteLength;
    }
    for (let row = 0; row < rows; ++row) {
      for (const { count, item } of properties) {
        if (at + (count ?? item).bytes > view.byteLength) return false;
        const items = count === null ? 1 : Math.max(0, Math.ceil(count.read(view, at, little)) || 0);
        at += (count?.bytes ?? 0) + items * item.bytes;
      }
    }
    return at <= view.byteLength;
  };
}

function wordsOf(body: Uint8Array): Skip {
  let at = 0;
  const next = (): boolean => {
    while (at < body.length && body[at]! <= kSpace) ++at;
    const is = at < body.length;
    while (at < body.length && body[at]! > kSpace) ++at;
    return is;
  };
  const number = (): number => {
    const end = at;
    while (at > 0 && body[at - 1]! > kSpace) --at;
    const word = new TextDecoder().decode(body.subarray(at, end));
    at = end;
    return parseInt(word) || 0;
  };
  return (rows, properties) => {
    for (let row = 0; row < rows; ++row) {
      for (const { count } of properties) {
        if (!next()) return false;
        for (let left = count === null ? 0 : number(); left > 0; --left) if (!next()) return false;
      }
    }
    return true;
  };
}
