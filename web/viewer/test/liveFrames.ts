// SPDX-License-Identifier: Apache-2.0
// Frames of a live stream, as they come.
import type { FramePrefix } from '../src/protocol';

const kPrefixBytes = 48;
const kFrameBytes = 64 + 8 + 1;
export const kUtcMs = 1.7e12;

/** A whole message: a grid without vertices, key or delta, behind its prefix. */
export function message(isKey: boolean): ArrayBuffer {
  const bytes = new Uint8Array(kPrefixBytes + kFrameBytes);
  const view = new DataView(bytes.buffer);
  view.setUint32(0, kPrefixBytes, true);
  bytes.set([0x52, 0x4c, 0x56, 0x46, 1, isKey ? 1 : 0], kPrefixBytes);
  const at = kPrefixBytes;
  view.setUint16(at + 6, 72, true);
  view.setUint32(at + 40, 1, true); // vertices
  view.setUint8(at + 56, 1);
  view.setUint8(at + 57, 8);
  view.setUint16(at + 58, 64, true);
  view.setUint8(at + 64, 1); // geometry
  view.setUint8(at + 65, 2); // a grid
  view.setUint32(at + 68, 1, true);
  return bytes.buffer;
}
export const prefix = (sequence: number, atMs: number): FramePrefix => ({
  bytes: kPrefixBytes,
  sequence,
  captureMs: kUtcMs + atMs,
  publishMs: kUtcMs + atMs + 20,
  sentMs: kUtcMs + atMs + 21,
  drops: 0,
});
