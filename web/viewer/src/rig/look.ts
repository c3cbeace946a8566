// SPDX-License-Identifier: Apache-2.0
// What the server says of one frame of a rig's camera: GET /api/rig/STREAM (docs/WEB.md).

export const kPictures = ['camera', 'complement', 'exposure', 'coverage', 'order', 'difference', 'boundaries'] as const;
export type PictureName = (typeof kPictures)[number];

export interface Margin {
  colour: string; // "100": red
  pieces: number;
  median: number | null;
  low: number | null;
  wrong: number | null;
}

export interface Look {
  state: 'measured';
  stream: string;
  frame: number;
  exposure: {
    histogram: Record<'red' | 'green' | 'blue', number[]>;
    clipped: number;
    clipped_level: number;
    dark: number;
    dark_level: number;
    bright: number;
  };
  margins: Margin[];
  margin_needed: number;
  noise: number;
  coverage: { lit: number; share: number };
  boundaries: { seen: number; matched: number; points: number; neighbours: number; order_errors: number };
  step: { mixed: number; regrouped: number; phase: number | null; drift_fields_s: number | null };
  advice: string[];
  pictures: PictureName[];
}

/** The server said no, and why. */
export class Refused extends Error {
  constructor(
    why: string,
    readonly status: number,
  ) {
    super(why);
  }
}

const address = (path: string): URL => new URL(path, document.baseURI);

/** Null: no frame was looked at yet. The picture can be had when a look names it. */
export async function lookAt(stream: string, picture: PictureName): Promise<Look | null> {
  const response = await ask(`api/rig/${encodeURIComponent(stream)}?pictures=${picture}`);
  const look = (await response.json()) as Look | { state: 'waiting' };
  return look.state === 'measured' ? look : null;
}

/** Null: there is none now, as while what it is of begins or ends. */
export async function pictureAt(path: string): Promise<ImageBitmap | null> {
  try {
    return await createImageBitmap(await (await ask(path)).blob());
  } catch (error) {
    if (error instanceof Refused && error.status === 503) return null;
    throw error;
  }
}

export const pictureOf = (stream: string, picture: PictureName): Promise<ImageBitmap | null> =>
  pictureAt(`api/rig/${encodeURIComponent(stream)}/${picture}.jpg`);

export async function streamNames(): Promise<string[]> {
  const list = (await (await ask('api/streams')).json()) as { streams: { name: string }[] };
  return list.streams.map(({ name }) => name);
}

export async function ask(path: string, init: RequestInit = {}): Promise<Response> {
  const response = await fetch(address(path), { cache: 'no-store', signal: AbortSignal.timeout(5000), ...init });
  if (response.status === 401) location.reload(); // the page that the server answers with asks for a token
  if (!response.ok) throw new Refused((await response.text()).trim() || `HTTP ${response.status}`, response.status);
  return response;
}
