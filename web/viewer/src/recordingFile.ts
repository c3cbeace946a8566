// SPDX-License-Identifier: Apache-2.0
// Writes messages into a recording: MCAP as `relievo record` writes it, less the attachments. Loaded when it is needed.
import { McapWriter } from '@mcap/core';
import idl from '../../../idl/relievo.idl?raw';
import type { Sample } from './frameStore';

const kChunkBytes = 4 * 2 ** 20;

class Parts {
  readonly list: Blob[] = []; // which the browser may keep on its disk
  private size = 0;
  position = (): bigint => BigInt(this.size);
  write = async (part: Uint8Array): Promise<void> => {
    this.list.push(new Blob([part.slice()])); // the writer uses its buffer again
    this.size += part.length;
  };
}

export interface DescribedSample {
  sample: Sample; // a frame
  description: Uint8Array | null; // its relievo::StreamInfo
}

/**
 * `frames`: oldest first, at least one; a description is written where it is another one than before. Throws what
 * `frames` throws.
 */
export async function writeRecording(
  stream: string,
  frames: Iterable<DescribedSample> | AsyncIterable<DescribedSample>,
): Promise<Blob> {
  const parts = new Parts();
  const writer = new McapWriter({ writable: parts, chunkSize: kChunkBytes });
  await writer.start({ profile: '', library: 'relievo viewer' });
  const channel = async (topic: string, type: string): Promise<number> => {
    const schemaId = await writer.registerSchema({ name: type, encoding: 'omgidl', data: new TextEncoder().encode(idl) });
    return writer.registerChannel({ topic, schemaId, messageEncoding: 'cdr', metadata: new Map([['stream', stream]]) });
  };
  const ofFrames = await channel('relievo/frame', 'relievo::Frame');
  let ofInfo: number | null = null;
  let described: Uint8Array | null = null;
  for await (const { sample, description } of frames) {
    const { data, sequence, logNs: logTime, publishNs: publishTime } = sample;
    if (description !== null && description !== described) {
      described = description;
      ofInfo ??= await channel('relievo/info', 'relievo::StreamInfo');
      await writer.addMessage({ channelId: ofInfo, sequence: 0, logTime, publishTime, data: description });
    }
    await writer.addMessage({ channelId: ofFrames, sequence, logTime, publishTime, data });
  }
  await writer.end();
  return new Blob(parts.list, { type: 'application/octet-stream' });
}
