// SPDX-License-Identifier: Apache-2.0
// Proves: a recording of a server that was started again has what describes each part, and so has what is saved of it.
import { expect, it } from 'vitest';
import { writeFrame, writeStreamInfo } from '../src/cdrWriter';
import { bytesOf } from '../src/mcap';
import { frameAt } from '../src/playback';
import { Recording } from '../src/recording';
import { writeRecording } from '../src/recordingFile';
import { kInfo } from './streamInfo';

const kStartMs = 1_700_000_000_000;
const kPeriodMs = 33;
const kSources = ['one', 'one', 'other', 'other', 'one', 'one'];

const publishMs = (index: number): number => kStartMs + index * kPeriodMs;

function recorded(sources: string[], publishMs = (index: number): number => kStartMs + index * kPeriodMs): Promise<Blob> {
  const descriptions = new Map(sources.map((source) => [source, writeStreamInfo({ ...kInfo, source })]));
  const { stream } = kInfo;
  const data = Uint8Array.from([0x52, 0x4c, 0x56, 0x46, 1, 1, 9, 9]);
  const frames = sources.map((source, i) => {
    const publishNs = BigInt(Math.round(publishMs(i) * 1000)) * 1000n;
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

it('has a time of its own for each frame, whatever the clock did, of which a link can tell', async () => {
  const clock = [0, 0, 0, 33, 33.5, 34, 500];
  const { times } = await Recording.open(bytesOf(await recorded(clock.map(() => 'one'), (i) => kStartMs + clock[i]!)));
  const linked = [...times].map(Math.ceil);
  expect([...times].map((_, i) => frameAt(times, linked[i]!))).toEqual(clock.map((_, i) => i));
  expect(times[0]).toBe(0);
  expect(times[6]).toBe(500);
});

it('finds the frame that was captured at a moment, which came later, and no moment that it does not have', async () => {
  const recording = await Recording.open(bytesOf(await recorded(kSources)));
  for (const [i, time] of recording.times.entries()) {
    expect(await recording.timeOf(publishMs(i))).toBe(time);
    expect(await recording.timeOf(publishMs(i) - 0.5)).toBe(i === 0 ? null : recording.times[i - 1]);
  }
  expect(await recording.timeOf(publishMs(kSources.length - 1) + 2)).toBeNull();
});
