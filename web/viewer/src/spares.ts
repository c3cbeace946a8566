// SPDX-License-Identifier: Apache-2.0
// Memory of frames that nobody shows any more, to be filled again. New memory of this size costs the browser more time, page by
// page, than all of the decoding.

const kMost = 12; // two frames of all that there can be
const kRoom = 1.125; // of what is asked for: surfaces change their size from frame to frame
const kTooLarge = 4; // times what is asked for
const kLargest = 2 ** 25; // bytes, of files: they are shown once

export class Spares {
  private readonly buffers: ArrayBuffer[] = [];

  add(buffers: readonly ArrayBuffer[]): void {
    this.buffers.push(...buffers.filter(({ byteLength }) => byteLength > 0 && byteLength <= kLargest));
    this.buffers.splice(0, this.buffers.length - kMost); // the oldest
  }

  floats(count: number): Float32Array<ArrayBuffer> {
    return new Float32Array(this.take(4 * count), 0, count);
  }
  indices(count: number): Uint32Array<ArrayBuffer> {
    return new Uint32Array(this.take(4 * count), 0, count);
  }
  bytes(count: number): Uint8Array<ArrayBuffer> {
    return new Uint8Array(this.take(count), 0, count);
  }

  copy<T extends Float32Array | Uint32Array | Uint8Array>(from: T): T {
    const to = new (from.constructor as new (buffer: ArrayBuffer, offset: number, length: number) => T)(this.take(from.byteLength), 0, from.length);
    to.set(from);
    return to;
  }

  /** The smallest that is large enough, or new memory; what is in it may be anything. */
  private take(bytes: number): ArrayBuffer {
    let best = -1;
    this.buffers.forEach(({ byteLength }, i) => {
      const fits = byteLength >= bytes && byteLength <= kTooLarge * bytes && byteLength % 4 === 0;
      if (fits && (best < 0 || byteLength < this.buffers[best]!.byteLength)) best = i;
    });
    if (best < 0) return new ArrayBuffer(Math.ceil((kRoom * bytes) / 4) * 4);
    return this.buffers.splice(best, 1)[0]!;
  }
}
