// SPDX-License-Identifier: Apache-2.0
// Writes frames as they came over the WebSocket into a recording: MCAP as `relievo record` writes it, less the
// attachments. Loaded when it is needed.
import { McapWriter } from '@mcap/core';
import idl from '../../../idl/relievo.idl?raw';
import { writeFrame, writeStreamInfo } from './cdrWriter';
import type { StreamInfo } from './protocol';

const kChunkBytes = 4 * 2 ** 20;

class Parts {
  readonly list: Uint8Array<ArrayBuffer>[] = [];
  private size = 0;
  position = (): bigint => BigInt(this.size);
  write = async (part: Uint8Array): Promise<void> => {
    this.list.push(part.slice()); // the writer uses its buffer again
    this.size += part.length;
  };
}

/** `messages`: frames with their prefixes (docs/WEB.md), oldest first, at least one. */
export async function writeRecording(stream: string, info: StreamInfo | null, messages: readonly ArrayBuffer[]): Promise<Blob> {
  const parts = new Parts();
  const writer = new McapWriter({ writable: parts, chunkSize: kChunkBytes });
  await writer.start({ profile: '', library: 'relievo viewer' });
  const channel = async (topic: string, type: string): Promise<number> => {
    const schemaId = await writer.registerSchema({ name: type, encoding: 'omgidl', data: new TextEncoder().encode(idl) });
    return writer.registerChannel({ topic, schemaId, messageEncoding: 'cdr', metadata: new Map([['stream', stream]]) });
  };
  const frames = await channel('relievo/frame', 'relievo::Frame');
  const described = info === null ? null : writeStreamInfo(info);
  if (described !== null) {
    const logTime = new DataView(messages[0]!).getBigInt64(32, true);
    const channelId = await channel('relievo/info', 'relievo::StreamInfo');
    await writer.addMessage({ channelId, sequence: 0, logTime, publishTime: logTime, data: described });
  }
  for (const message of messages) {
    const view = new DataView(message);
    const at = view.getUint32(0, true); // where the frame begins
    const [sequence, captureNs, publishNs] = [view.getBigUint64(8, true), view.getBigInt64(16, true), view.getBigInt64(24, true)];
    const number = view.getBigUint64(at + 8, true);
    const data = writeFrame({ stream, sequence, number, captureNs, publishNs, data: new Uint8Array(message, at) });
    const logTime = view.getBigInt64(32, true); // when the server sent it
    await writer.addMessage({ channelId: frames, sequence: Number(sequence & 0xffffffffn), logTime, publishTime: publishNs, data });
  }
  await writer.end();
  return new Blob(parts.list, { type: 'application/octet-stream' });
}
