// SPDX-License-Identifier: Apache-2.0
// What the page tells tests and bug reports of itself.
import type { Companions } from './companions';
import { crc32 } from './crc32';
import type { Measuring } from './laterParts';
import { reportOf, type PixelReport } from './pixels';
import type { Offered } from './qualityControl';
import type { Session } from './session';
import type { Playback } from './source';
import type { State } from './state';
import type { View } from './view';

declare global {
  interface Window {
    /** For tests and bug reports; not a stable interface. */
    relievo: {
      diagnostics(): object;
      readPixels(): Promise<PixelReport> | null;
      /** RGBA at a place of the canvas, in pixels of the page. */
      pixelAt(x: number, y: number): Promise<number[]>;
      pick(x: number, y: number): object | null;
      toPage(point: [number, number, number]): object | null;
      pose(): object | null;
      link(): string;
      extent(): object | null;
      /** The surface shown, told apart from others by a hash of its numbers, or by its mean depth in metres where other
       * decoders, which round elsewhere, are to tell the same. */
      surface(): { number: number; depth: number; hash: number } | null;
    };
  }
}

export interface Reporting {
  readonly view: View | null;
  diagnostics(): object;
  link(): string;
}

export function report(viewer: Reporting): void {
  window.relievo = {
    diagnostics: () => viewer.diagnostics(),
    readPixels: () => viewer.view?.pixels().then(reportOf) ?? null,
    pixelAt: async (x, y) => {
      const { width, height, rgba } = await viewer.view!.pixels();
      const { clientWidth, clientHeight } = viewer.view!.canvas;
      const column = Math.floor((x / clientWidth) * width);
      const row = height - 1 - Math.floor((y / clientHeight) * height);
      return [...rgba.slice((row * width + column) * 4, (row * width + column) * 4 + 4)];
    },
    pick: (x, y) => viewer.view?.pick({ x, y }) ?? null,
    toPage: (point) => viewer.view?.navigator.toPage(point) ?? null,
    extent: () => viewer.view?.shown?.extent ?? null,
    surface: () => {
      const frame = viewer.view?.shown ?? null;
      if (frame === null) return null;
      const { buffer, byteOffset, byteLength } = frame.positions;
      let depth = 0;
      for (let i = 2; i < frame.positions.length; i += 3) depth += frame.positions[i]!;
      depth /= Math.max(1, frame.positions.length / 3);
      return { number: frame.number, depth, hash: crc32(new Uint8Array(buffer, byteOffset, byteLength)) };
    },
    link: () => viewer.link(),
    pose: () => viewer.view?.navigator.pose ?? null,
  };
}

export interface Diagnosed {
  readonly view: View | null;
  readonly session: Session;
  readonly companions: Companions | null;
  readonly measure: Measuring | null;
  readonly state: State | undefined;
  readonly stream: string | null;
  readonly file: string | null;
  readonly quality: Offered | null;
  readonly problem: string | null;
}

export function diagnosticsOf({ view, session, companions, measure, ...said }: Diagnosed): object {
  return {
    ...said,
    playback: playbackReport(session.source?.playback ?? null),
    mode: view?.mode,
    way: view?.navigator.way,
    cameraPicture: view?.navigator.picture, // where it lies on the page
    drawn: view?.drawn,
    busy: view?.isBusy === true || session.isBusy || companions?.isBusy === true,
    scale: view?.movingScale,
    depthRange: view?.depthRange,
    gridStep: view?.gridStep,
    besides: companions?.report(),
    measurements: measure?.measurements,
    flatness: measure?.flatness,
    keptBytes: session.source?.kept?.bytes,
    ...session.meter.report(),
  };
}

/** What the time line shows. */
function playbackReport(playback: Playback | null): object | null {
  if (playback === null) return null;
  const keys = Array.from(playback.times, (_, i) => playback.isKey(playback.first + i));
  const gaps = keys.map((_, i) => playback.gapBefore(playback.first + i));
  const { first, index, position, playing, speed, loop, following } = playback;
  return { first, index, position, playing, speed, loop, following, keys, gaps, times: [...playback.times] };
}
