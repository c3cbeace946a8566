// SPDX-License-Identifier: Apache-2.0
// What kind of file it is, and what to read it with. The readers are loaded when they are needed.
import { FileError, fileError } from './fileError';
import type { Bytes } from './mcap';
import type { DecodedFrame } from './messages';
import type { Fetch } from './remoteFile';
import type { FrameSource, Moment, SourceEvents } from './source';
import { text } from './strings';

/** Of a PLY or GLB, which are read whole: what is made of them takes some ten times as much. */
export const kMaxSurfaceBytes = 256e6;

export interface OpenedRecording {
  kind: 'recording';
  source(events: SourceEvents, begin?: Moment | null): FrameSource;
  note: string | null;
  /** As a live stream's frames have it: at which of `times` the last frame until then is; null: it has not recorded then. */
  timeOf(utcMs: number): Promise<number | null>;
  /** Whether more is being written behind what there is now. */
  isGrowing(): boolean;
}

export type Opened =
  | OpenedRecording
  | { kind: 'surface'; frame: DecodedFrame; note: string | null };

async function openRecording(bytes: Bytes, isGrowing = (): boolean => false, note: string | null = null): Promise<OpenedRecording> {
  const [{ Recording }, { RecordingSource }] = await Promise.all([import('./recording'), import('./recordingSource')]);
  const recording = await Recording.open(bytes);
  return { kind: 'recording', source: (events, begin) => new RecordingSource(recording, events, begin), note: recording.damage ?? note, timeOf: (utcMs) => recording.timeOf(utcMs), isGrowing };
}

/** Of one in the server's folder. */
export const recordingUrl = (file: string): URL => new URL(`recordings/${encodeURIComponent(file)}`, document.baseURI);

/** A recording of the server. Throws with what a person should know. */
export async function openRemote(url: URL, fetch?: Fetch): Promise<OpenedRecording> {
  const { RemoteFile } = await import('./remoteFile');
  const file = await RemoteFile.open(url, fetch);
  return openRecording(file, () => file.isGrowing, file.isCut ? text.file.wasCut : null);
}

const kindOf = ({ name }: File): string | undefined => /\.(mcap|ply|glb)$/i.exec(name)?.[1]!.toLowerCase();

/** Of several, which are shown one at a time, the first that may be shown. Throws a FileError. */
export async function openFile(files: readonly [File, ...File[]]): Promise<Opened> {
  const file = firstOf(files);
  const kind = kindOf(file);
  if (kind === undefined) throw new FileError(text.file.otherKind);
  if (file.size === 0) throw new FileError(text.file.empty);
  const read = await (kind === 'mcap' ? recordingReader() : surfaceReader()).catch(() => {
    throw new FileError(text.file.noReader);
  });
  const opened = await read(file).catch((error: unknown) => {
    throw fileError(error);
  });
  if (files.length > 1) opened.note = [opened.note ?? [], text.file.oneOf(files.length)].flat().join('; ');
  return opened;
}

export const firstOf = (files: readonly [File, ...File[]]): File => files.find((file) => kindOf(file) !== undefined) ?? files[0];

type Reader = (file: File) => Promise<Opened>;

async function recordingReader(): Promise<Reader> {
  const [{ bytesOf }] = await Promise.all([import('./mcap'), import('./recording'), import('./recordingSource')]);
  return (file) => openRecording(bytesOf(file));
}

async function surfaceReader(): Promise<Reader> {
  const { readSurface } = await import('./surfaceFile');
  return async (file) => {
    if (file.size > kMaxSurfaceBytes) throw new FileError(text.file.tooLarge(file.size, kMaxSurfaceBytes));
    return { kind: 'surface', frame: await readSurface(file.name, await file.arrayBuffer()), note: null };
  };
}
