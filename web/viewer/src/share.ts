// SPDX-License-Identifier: Apache-2.0
// A link that shows somebody else the same: stream or recording, time, view, display and what was measured. The part behind # is not sent to any server. Pure.
import { parseDisplay, writeDisplay, type Display } from './display';
import type { Pose } from './navigator';
import type { Vec3 } from './pick';
import type { Quality } from './protocol';
import { axisOf, rigidOf, type Rigid } from './rigid';
import type { Moment, Playback } from './source';

/** What a link is of: streams of the server, the first and those beside it, or a recording in its folder. */
export interface Shown {
  readonly kind: 'stream' | 'recording';
  readonly name: string;
  readonly quality?: Quality | null; // that was chosen for a stream
}

/** Over an address; what else it asked for is gone. Null: it is of nothing of the server. */
export function address(page: string, shown: Shown | null): URL {
  const url = new URL(page);
  url.search = shown === null ? '' : `?${shown.kind}=${shown.name}`; // names hold no character that would have to be escaped
  if (shown?.quality != null) url.search += `&quality=${shown.quality}`;
  return url;
}

export interface Shared {
  readonly display: Display;
  readonly pose: Pose | null;
  readonly moment: Moment | null;
  /** Where streams stand in the first one's frame, by name. */
  readonly places: ReadonlyMap<string, Rigid>;
  readonly measured: Measured;
}

/** What was measured, as shareMeasure.ts writes and reads it. */
export interface Measured {
  readonly measurements: readonly string[];
  readonly flatness: string | null;
}

const kMostMeasurements = 64; // of a link; the last ones

/** What an address is of, the first stream first. */
export function namesOf(search: string): string[] {
  const given = new URLSearchParams(search);
  const recording = given.get('recording');
  return given.has('stream') || recording === null ? (given.get('stream') ?? '').split(',').filter((name) => name !== '') : [recording];
}

/** The time that is shown. Of a live stream: none, or that of day where a person went back in it. Null: there is none yet. */
export function momentOf(playback: Playback | null): Moment | 'live' | null {
  if (playback === null || playback.times.length === 0) return null;
  const { position, startMs, following, playing } = playback;
  if (following === true) return 'live';
  const utc = following === false;
  return { atMs: position + (utc ? startMs : 0), utc, playing };
}

/** To what a link says of time, also where something is shown already. */
export function goTo(playback: Playback, { atMs, utc, playing }: Moment): void {
  playback.seek(atMs - (utc ? playback.startMs : 0));
  if (playing) playback.play();
  else playback.pause();
}

/** Over the address of the page; `pose` null: the first view. */
export function shareLink(
  page: string,
  shown: Shown | null,
  display: Display,
  pose: Pose | null,
  moment: Moment | 'live' | null,
  places: ReadonlyMap<string, Rigid> = new Map(),
  measured: Measured = { measurements: [], flatness: null },
): string {
  const url = address(page, shown);
  const state = writeDisplay(display, null);
  state.delete('theme'); // is the reader's own
  if (pose !== null) {
    const write = (v: Vec3): string => v.map((c) => Number(c.toFixed(4))).join('_');
    state.set('eye', write(pose.position));
    state.set('at', write(pose.target));
  }
  if (shown !== null && moment !== null) {
    state.set('time', moment === 'live' ? 'live' : timeText(moment));
    if (moment !== 'live') state.set('play', moment.playing ? '1' : '0');
  }
  for (const [name, rigid] of places) {
    const numbers = [...axisOf(rigid), ...rigid.translation].map((c) => Number(c.toFixed(5)));
    state.append('place', [name, ...numbers].join('_'));
  }
  for (const measurement of measured.measurements.slice(-kMostMeasurements)) state.append('measure', measurement);
  if (measured.flatness !== null) state.set('flat', measured.flatness);
  url.hash = state.toString();
  return url.href;
}

/** What a link's part behind # asks for; any input. */
export function readShared(hash: string, fallback: Display): Shared {
  const text = hash.replace(/^#/, '');
  const given = new URLSearchParams(text);
  const read = (key: string): Vec3 | null => {
    const numbers = (given.get(key) ?? '').split('_').map((part) => (part === '' ? NaN : Number(part)));
    return numbers.length === 3 && numbers.every((n) => Math.abs(n) < 1e4) ? (numbers as Vec3) : null;
  };
  const [position, target] = [read('eye'), read('at')];
  const apart = position !== null && target !== null && position.some((c, i) => Math.abs(c - target[i]!) > 1e-6);
  const pose = apart ? { position: position!, target: target! } : null;
  const measured = { measurements: given.getAll('measure').slice(-kMostMeasurements), flatness: given.get('flat') };
  return { display: parseDisplay(text, fallback), pose, moment: readMoment(given), places: readPlaces(given), measured };
}

// A name, which may hold underscores, and six numbers: of rigidOf().
function readPlaces(given: URLSearchParams): Map<string, Rigid> {
  const places = new Map<string, Rigid>();
  for (const written of given.getAll('place')) {
    const parts = written.split('_');
    const numbers = parts.slice(-6).map((part) => (part === '' ? NaN : Number(part)));
    const name = parts.slice(0, -6).join('_');
    if (name === '' || !numbers.every((n) => Math.abs(n) < 1e4)) continue;
    places.set(name, rigidOf(numbers.slice(0, 3) as Vec3, numbers.slice(3) as Vec3));
  }
  return places;
}

// Rounded up: a frame is there from its time on.
function timeText({ atMs, utc }: Moment): string {
  const whole = Math.ceil(atMs);
  return utc ? new Date(whole).toISOString() : (whole / 1000).toFixed(3);
}

function readMoment(given: URLSearchParams): Moment | null {
  const time = given.get('time') ?? '';
  const playing = given.get('play') !== '0';
  if (/^\d{1,7}(\.\d{1,3})?$/.test(time)) return { atMs: Math.round(Number(time) * 1000), utc: false, playing };
  const atMs = /^\d{4}-\d\d-\d\dT[\d:.]+Z$/.test(time) ? Date.parse(time) : NaN;
  return Number.isNaN(atMs) ? null : { atMs, utc: true, playing };
}
