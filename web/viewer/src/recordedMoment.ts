// SPDX-License-Identifier: Apache-2.0
// Of a live stream: the recording in the server's folder that has a moment of it.
import { openRemote, recordingUrl, type OpenedRecording } from './openFile';
import type { ListedRecording, ListedStream } from './protocol';
import type { Moment } from './source';

export interface Found {
  readonly file: string;
  readonly opened: OpenedRecording;
}

/** By the clock of the stream's server. Null: none has it. */
export async function recordedAt({ name, recorder }: ListedStream, { utc, atMs }: Moment): Promise<Found | null> {
  if (!utc || (recorder ?? null) === null) return null; // there is no folder
  try {
    const response = await fetch(new URL('api/recordings', document.baseURI), { cache: 'no-store' });
    const { recordings } = (await response.json()) as { recordings: ListedRecording[] };
    // One after the other, the newest first: the oldest that was written to since begins last before it.
    const own = recordings.filter(({ file }) => file.startsWith(`${name}-`) && /^\d{4}-\d\d-\d\dT/.test(file.slice(name.length + 1)));
    const since = own.filter(({ recording, modified_ns }) => recording || modified_ns / 1e6 >= atMs);
    const file = since[since.length - 1]?.file;
    if (file === undefined) return null;
    const opened = await openRemote(recordingUrl(file));
    return (await opened.timeOf(atMs)) === null ? null : { file, opened };
  } catch {
    return null;
  }
}
