// SPDX-License-Identifier: Apache-2.0
// What kind of file it is, and what to read it with. The readers are loaded when they are needed.
import type { Bytes } from './mcap';
import type { DecodedFrame } from './messages';
import type { FrameSource, Moment, SourceEvents } from './source';

export interface OpenedRecording {
  kind: 'recording';
  source(events: SourceEvents, begin?: Moment | null): FrameSource;
  note: string | null;
  /** Whether more is being written behind what there is now. */
  isGrowing(): boolean;
}

export type Opened =
  | OpenedRecording
  | { kind: 'surface'; frame: DecodedFrame };

async function openRecording(bytes: Bytes, isGrowing = (): boolean => false): Promise<OpenedRecording> {
  const [{ Recording }, { RecordingSource }] = await Promise.all([import('./recording'), import('./recordingSource')]);
  const recording = await Recording.open(bytes);
  return { kind: 'recording', source: (events, begin) => new RecordingSource(recording, events, begin), note: recording.damage, isGrowing };
}

/** A recording of the server. Throws as openFile. */
export async function openRemote(url: URL): Promise<OpenedRecording> {
  const { RemoteFile } = await import('./remoteFile');
  const file = await RemoteFile.open(url);
  return openRecording(file, () => file.isGrowing);
}

/** Throws with what a person should know. */
export async function openFile(file: File): Promise<Opened> {
  if (/\.mcap$/i.test(file.name)) {
    const { bytesOf } = await import('./mcap');
    return openRecording(bytesOf(file));
  }
  if (/\.(ply|glb)$/i.test(file.name)) {
    const { readSurface } = await import('./surfaceFile');
    return { kind: 'surface', frame: await readSurface(file.name, await file.arrayBuffer()) };
  }
  throw new Error('only .mcap, .ply and .glb files can be shown');
}
