// SPDX-License-Identifier: Apache-2.0
// Proves: a recording of a server that was started again has what describes each part, and so has what is saved of it.
import { expect, it } from 'vitest';
import { writeFrame, writeStreamInfo } from '../src/cdrWriter';
import { bytesOf } from '../src/mcap';
import { Recording } from '../src/recording';
import { writeRecording } from '../src/recordingFile';
import { kInfo } from './streamInfo';

const kStartMs = 1_700_000_000_000;
const kPeriodMs = 33;
const kSources = ['one', 'one', 'other', 'other', 'one', 'one'];

const publishMs = (index: number): number => kStartMs + index * kPeriodMs;

function recorded(sources: string[]): Promise<Blob> {
  const descriptions = new Map(sources.map((source) => [source, writeStreamInfo({ ...kInfo, source })]));
  const { stream } = kInfo;
  const data = Uint8Array.from([0x52, 0x4c, 0x56, 0x46, 1, 1, 9, 9]);
  const frames = sources.map((source, i) => {
    const publishNs = BigInt(publishMs(i)) * 1_000_000n;
    const message = writeFrame({ stream, sequence: BigInt(i), number: BigInt(i), captureNs: publishNs, publishNs, data });
    const sample = { data: message, sequence: i, logNs: publishNs + 5_000_000n, publishNs };
    return { sample, description: descriptions.get(source)! };
  });
  return writeRecording(stream, frames);
}

it('has the description of each part', async () => {
  const recording = await Recording.open(bytesOf(await recorded(kSources)));
  expect(kSources.map((_, i) => recording.infoAt(publishMs(i))?.source)).toEqual(kSources);
  expect(recording.infoAt(-Infinity)?.source).toBe('one');
  expect(recording.describing(publishMs(3))).toEqual(writeStreamInfo({ ...kInfo, source: 'other' }));
});

it('takes no description of another stream for its own', async () => {
  const sample = await (await Recording.open(bytesOf(await recorded(['one'])))).sample(0);
  const description = writeStreamInfo({ ...kInfo, stream: 'stranger' });
  const recording = await Recording.open(bytesOf(await writeRecording(kInfo.stream, [{ sample, description }])));
  expect(recording.infoAt(publishMs(0))).toBeNull();
});
