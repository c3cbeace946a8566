// SPDX-License-Identifier: Apache-2.0
// The gateway's WebSocket messages (docs/WEB.md). Pure.

export interface Pinhole {
  width: number;
  height: number;
  fx: number;
  fy: number;
  cx: number;
  cy: number;
  distortion?: number[]; // k1 k2 p1 p2 k3; of none where missing
}

export interface StreamInfo {
  stream: string;
  source: string;
  frame_rate: number;
  scan: string;
  stripes: number;
  camera: Pinhole;
  // Not said by older servers.
  projector?: Pinhole;
  projector_from_camera_rotation?: number[]; // row-major
  projector_from_camera_translation?: number[]; // metres
  // How good its calibration found the rig, where it says so.
  stereo_rms_px?: number; // of the board's corners, in either picture
  scale_error?: number; // relative, of sizes
  // Where its camera stands in a frame shared with other rigs, where the rig says it.
  world_from_camera_rotation?: number[]; // row-major
  world_from_camera_translation?: number[]; // metres
  // What only a recording needs; not said by older servers.
  started_ns?: number;
  field_order?: string;
  colour_matrix?: number[]; // row-major
  camera_gamma?: number; // 1 where missing
  pattern?: Pattern;
}

/** The projected stripes. */
export interface Pattern {
  base: number;
  slides: number;
  palette: number[];
  sequence: number[];
  scheme: string;
}

export interface StreamStatus {
  state: 'starting' | 'running' | 'stalled' | 'ended';
  message: string;
  drops_capture: number;
  drops_reconstruct: number;
  drops_encode: number;
  drops_publish: number;
  reconstruct_ms?: number;
  encode_ms?: number;
  /** Lower qualities that it is offered in; not said by older servers. */
  rungs?: readonly { readonly quality: string }[];
}

/** How much detail a stream is sent with. */
export const kRungs = ['full', 'reduced', 'texture'] as const;
export type Rung = (typeof kRungs)[number];
/** What a page may ask for; auto: as much as it can follow. */
export const kQualities = ['auto', ...kRungs] as const;
export type Quality = (typeof kQualities)[number];

export type ServerMessage =
  | ({ type: 'info' } & StreamInfo)
  | ({ type: 'status' } & StreamStatus)
  | { type: 'waiting'; hint: string }
  | { type: 'gone' }
  | { type: 'quality'; now: Rung; of: Rung[] }
  | { type: 'time'; t0: number; server_ms: number | null } // null: how far its clock is off is not known yet;

const kTypes = ['info', 'status', 'waiting', 'gone', 'time', 'quality'];

/** Null for a type of a later version. Throws on what is no message at all. */
export function parseServerMessage(text: string): ServerMessage | null {
  const message = JSON.parse(text) as { type?: unknown };
  if (typeof message !== 'object' || message === null || typeof message.type !== 'string') {
    throw new Error('the server sent a message without a type');
  }
  if (message.type === 'quality') return parseQuality(message);
  return kTypes.includes(message.type) ? (message as ServerMessage) : null;
}

export interface FramePrefix {
  bytes: number; // of the prefix: where the frame starts
  sequence: number;
  captureMs: number; // UTC
  publishMs: number;
  sentMs: number;
  drops: number; // of this client so far
}

/** Throws where the message is too short to be a frame. */
export function parseFramePrefix(message: ArrayBuffer): FramePrefix {
  const view = new DataView(message);
  const bytes = message.byteLength >= 48 ? view.getUint32(0, true) : 0;
  if (bytes < 48 || bytes > message.byteLength) throw new Error('the server sent a frame without its prefix');
  const ms = (at: number): number => Number(view.getBigInt64(at, true) / 1000n) / 1000;
  return {
    bytes,
    sequence: Number(view.getBigUint64(8, true)),
    captureMs: ms(16),
    publishMs: ms(24),
    sentMs: ms(32),
    drops: Number(view.getBigUint64(40, true)),
  };
}

/** The quality that a page's address asks for (`?quality=auto`); null: it says none, or none that there is. */
export function wantedQuality(search: string): Quality | null {
  const wanted = new URLSearchParams(search).get('quality');
  return kQualities.find((quality) => quality === wanted) ?? null;
}

const isRung = (name: unknown): name is Rung => kRungs.some((rung) => rung === name);

// Of a later version: one that is not known here is as none.
function parseQuality({ now, of }: { type?: unknown; now?: unknown; of?: unknown }): ServerMessage | null {
  if (!isRung(now) || !Array.isArray(of)) return null;
  return { type: 'quality', now, of: of.filter(isRung) };
}

/** What a stream is offered in, by the latest that was said of it. */
export function offeredRungs(status: StreamStatus | null): Rung[] {
  return kRungs.filter((rung) => rung === 'full' || (status?.rungs ?? []).some(({ quality }) => quality === rung));
}

/** A file of the server's folder, in /api/recordings. */
export interface ListedRecording {
  file: string;
  bytes: number;
  modified_ns: number; // UTC
  recording: boolean; // it grows
  cut: boolean; // it has no end
}

export interface ListedStream {
  name: string;
  source: string;
  state: string;
  /** Where the file is that it is played from, relative to the page; not said by older servers. */
  recording?: string | null;
  /** What can be read by now of such a file that is still being written; null, or not said: it does not grow. */
  growing_bytes?: number | null;
  /**
   * What its recording on request is doing, whoever started it; null: there is no folder. Not said by older
   * servers.
   */
  recorder?: ServerRecording | null;
  /** Whether the page /rig can show what its camera sees. */
  camera?: boolean;
}

/** The page that shows what a stream's camera sees. */
export const rigPage = (stream: string): string => `rig?stream=${encodeURIComponent(stream)}`;

/** What GET and POST /api/recording/STREAM answer. */
export interface ServerRecording {
  state: 'off' | 'recording' | 'failed';
  file: string;
  frames: number;
  bytes: number;
  /** What can be read of it by now; not said by older servers. */
  whole_bytes?: number;
  started_ns: number;
  pre_roll_s: number;
  message: string;
}

/** What is said of a file that is being written. */
export type Written = Pick<ServerRecording, 'state' | 'whole_bytes' | 'message'>;

/** Of the file that a stream is played from; undefined: it does not grow. */
export function writtenOf(listed: ListedStream | undefined): Written | undefined {
  const bytes = listed?.growing_bytes ?? null;
  return bytes === null ? undefined : { state: 'recording', whole_bytes: bytes, message: '' };
}

export interface StreamList {
  version: string;
  hint: string;
  streams: ListedStream[];
}
