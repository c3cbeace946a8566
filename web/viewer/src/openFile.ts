// SPDX-License-Identifier: Apache-2.0
// What kind of file it is, and what to read it with. The readers are loaded when they are needed.
import type { DecodedFrame } from './messages';
import type { FrameSource, SourceEvents } from './source';

export type Opened =
  | { kind: 'recording'; source(events: SourceEvents): FrameSource; note: string | null }
  | { kind: 'surface'; frame: DecodedFrame };

/** Throws with what a person should know. */
export async function openFile(file: File): Promise<Opened> {
  if (/\.mcap$/i.test(file.name)) {
    const [{ bytesOf }, { Recording }, { RecordingSource }] = await Promise.all([
      import('./mcap'),
      import('./recording'),
      import('./recordingSource'),
    ]);
    const recording = await Recording.open(bytesOf(file));
    return { kind: 'recording', source: (events) => new RecordingSource(recording, events), note: recording.damage };
  }
  if (/\.(ply|glb)$/i.test(file.name)) {
    const { readSurface } = await import('./surfaceFile');
    return { kind: 'surface', frame: await readSurface(file.name, await file.arrayBuffer()) };
  }
  throw new Error('only .mcap, .ply and .glb files can be shown');
}
