// SPDX-License-Identifier: Apache-2.0
// A message of the WebSocket (docs/WEB.md) as recordings hold it. Loaded when it is needed.
import { writeFrame } from './cdrWriter';
import type { Sample } from './frameStore';

/** `message`: a frame with its prefix. */
export function sampleOf(stream: string, message: ArrayBuffer): Sample {
  const view = new DataView(message);
  const at = view.getUint32(0, true); // where the frame begins
  const [sequence, captureNs, publishNs] = [view.getBigUint64(8, true), view.getBigInt64(16, true), view.getBigInt64(24, true)];
  const number = view.getBigUint64(at + 8, true);
  const data = writeFrame({ stream, sequence, number, captureNs, publishNs, data: new Uint8Array(message, at) });
  const logNs = view.getBigInt64(32, true); // when the server sent it
  return { data, sequence: Number(sequence & 0xffffffffn), logNs, publishNs };
}
