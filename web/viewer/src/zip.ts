// SPDX-License-Identifier: Apache-2.0
// A ZIP file of files as they are, uncompressed (APPNOTE 6.3.3, without ZIP64).
import { crc32 } from './crc32';

const kLocal = 0x04034b50;
const kCentral = 0x02014b50;
const kEnd = 0x06054b50;
const kVersion = 20;
const kUtf8 = 1 << 11;
const kDate = (46 << 9) | (1 << 5) | 1; // the first of January 2026: what is in it says its own time
/** Of a file that a page makes: ZIP ends at 4 GiB, browsers' memory before. */
export const kMostBytes = 2e9;
const kMostFiles = 65_535;

export class ZipWriter {
  private readonly parts: Blob[] = []; // which the browser may keep on its disk
  private readonly directory: Uint8Array<ArrayBuffer>[] = [];
  private size = 0;

  constructor(private readonly most = kMostBytes) {}

  /** False, and nothing was added: there is no more room. `name`: ASCII. */
  add(name: string, content: Uint8Array<ArrayBuffer>): boolean {
    const encoded = new TextEncoder().encode(name);
    const [length, crc] = [content.length, crc32(content)];
    const local = entry(kLocal, encoded, length, crc);
    if (this.directory.length === kMostFiles || this.size + local.length + length > this.most) return false;
    const central = entry(kCentral, encoded, length, crc);
    new DataView(central.buffer).setUint32(42, this.size, true); // where the file begins
    this.directory.push(central);
    this.parts.push(new Blob([local, content]));
    this.size += local.length + length;
    return true;
  }

  finish(): Blob {
    const bytes = this.directory.reduce((sum, { length }) => sum + length, 0);
    const end = new DataView(new ArrayBuffer(22));
    end.setUint32(0, kEnd, true);
    end.setUint16(8, this.directory.length, true);
    end.setUint16(10, this.directory.length, true);
    end.setUint32(12, bytes, true);
    end.setUint32(16, this.size, true);
    return new Blob([...this.parts, ...this.directory, end.buffer], { type: 'application/zip' });
  }
}

// What both kinds of heads say of a file stands in the same order, behind its one or two versions.
function entry(signature: typeof kLocal | typeof kCentral, name: Uint8Array, length: number, crc: number): Uint8Array<ArrayBuffer> {
  const [headBytes, at] = signature === kLocal ? [30, 4] : [46, 6];
  const bytes = new Uint8Array(headBytes + name.length);
  const view = new DataView(bytes.buffer);
  view.setUint32(0, signature, true);
  view.setUint16(4, kVersion, true);
  view.setUint16(at, kVersion, true);
  view.setUint16(at + 2, kUtf8, true);
  view.setUint16(at + 8, kDate, true);
  view.setUint32(at + 10, crc, true);
  view.setUint32(at + 14, length, true);
  view.setUint32(at + 18, length, true);
  view.setUint16(at + 22, name.length, true);
  bytes.set(name, headBytes);
  return bytes;
}
