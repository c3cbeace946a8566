// SPDX-License-Identifier: Apache-2.0
// The rim of a flat face in the camera's picture, which lies on the mesh exactly: the change of colour along it, near where
// the mesh ends, to a fraction of a pixel. Pure.
import type { Rim } from './outline';

/** A part of the camera's picture, whose pixels may be larger than the camera's. */
export interface Crop {
  readonly x: number; // of its first pixel in that picture
  readonly y: number;
  readonly width: number;
  readonly height: number;
  readonly rgba: Uint8ClampedArray;
  /** Where a ray is in that picture; the centre of its first pixel is (0, 0). */
  place(u: number, v: number): readonly [number, number];
}

const kFine = 0.5; // pixels, between places of a profile
const kMostProfiles = 112;
const kInward = [0.5, 2] as const; // steps and pixels, that are looked at inside of the mesh's rim
const kOutward = [1.8, 4] as const;
const kContrast = 2.5; // of 255 a pixel, at least, as the mean of all profiles
const kOver = [0.4, 0.8] as const; // steps and pixels that the mesh may go beyond its rim
const kUnder = [1.3, 0.8] as const; // and may end before it
const kFirst = 0.3; // of the strongest: the innermost such edge is the face's own
const kCut = 2.5; // of the scatter
const kRounds = 3;
const kGroups = 16; // of profiles
const kLeastOfGroup = 3;
const kLeastSingle = 0.1; // pixels: no group of profiles is known better
const kFoot = 0.12; // of an edge's strength: there it ends
const kRise = 0.08; // and there the next one begins
const kPixel = 0.1; // pixels: what light, lens and compression move an edge by, all of it alike

/** The rim as the picture shows it, near that of the mesh; null where it shows none. */
export function pictureRim(rim: Rim, crop: Crop): Rim | null {
  const { normal, offset, from, to, step } = rim;
  const middle = (from + to) / 2;
  const rayAt = (along: number, out: number): [number, number] => [
    normal[0] * out - normal[1] * along,
    normal[1] * out + normal[0] * along,
  ];
  const [x0, y0] = crop.place(...rayAt(middle, offset));
  const [x1, y1] = crop.place(...rayAt(middle, offset + step));
  const [x2, y2] = crop.place(...rayAt(middle + step, offset));
  const perOut = Math.hypot(x1 - x0, y1 - y0) / step; // pixels
  const perAlong = Math.hypot(x2 - x0, y2 - y0) / step;
  const steps = step * perOut;
  const meshAt = offset - step / 2;
  const [inward, outward] = [kInward[0] * steps + kInward[1], kOutward[0] * steps + kOutward[1]];
  const places = Math.ceil((inward + outward) / kFine);
  const long = (to - from) * perAlong - 4;
  const count = Math.min(kMostProfiles, Math.floor(long));
  if (count < 4 * kLeastOfGroup) return null;
  const along = Array.from({ length: count }, (_, i) => from + 2 / perAlong + ((i + 0.5) * long) / count / perAlong);
  const outAt = (s: number): number => meshAt + (s * kFine - inward) / perOut;
  const profiles: Float32Array[] = [];
  for (const t of along) {
    const profile = gradients(crop, places, (s) => rayAt(t, outAt(s)));
    if (profile === null) return null; // not all of it is in the picture
    profiles.push(profile);
  }
  const half = (count - 1) / 2;
  const perRay = (count - 1) / (along[count - 1]! - along[0]!); // profiles
  /** Whether the mesh ends at this line: on it, or not much more than a step before it, all along. */
  const endsAt = (line: Line): boolean => {
    const least = [Infinity, Infinity, Infinity];
    let beyond = 0;
    for (const { along: t, out } of rim.mesh) {
      const place = line.at + line.slope * ((t - along[0]!) * perRay - half);
      const lack = (outAt(place) - out) * perOut;
      const third = Math.min(2, Math.max(0, Math.floor((3 * (t - from)) / (to - from))));
      least[third] = Math.min(least[third]!, lack);
      if (lack < -kOver[0] * steps - kOver[1]) ++beyond;
    }
    return beyond <= 0.1 * rim.mesh.length && least.every((lack) => lack === Infinity || lack < kUnder[0] * steps + kUnder[1]);
  };
  const first = innermost(profiles, places, Math.max(4, steps / kFine), endsAt);
  if (first === null) return null;
  const found = follow(profiles, places, first);
  if (found === null) return null;
  const { at, slope, varianceAt, varianceSlope } = found; // places; a profile
  const toRay = kFine / perOut;
  const tilt = slope * toRay * perRay;
  const out = outAt(at);
  // normal · ray = out + tilt (along · ray - middle), turned to a unit normal.
  const turned: [number, number] = [normal[0] + tilt * normal[1], normal[1] - tilt * normal[0]];
  const size = Math.hypot(...turned);
  const late = Math.max(0, out - meshAt - step); // a mesh ends a step too early: beyond that it may be another's edge
  const floor = (kPixel / perOut) ** 2 + late ** 2;
  const centre = (along[0]! + along[count - 1]!) / 2;
  return {
    normal: [turned[0] / size, turned[1] / size],
    offset: (out - tilt * centre) / size,
    from: from + tilt * offset,
    to: to + tilt * offset,
    step,
    lack: Math.max(0, out - meshAt),
    mesh: rim.mesh,
    source: 'picture',
    variance: (t) => floor + toRay ** 2 * (varianceAt + varianceSlope * ((t - centre) * perRay) ** 2),
  };
}

/** Of each place: how red, green and blue change a pixel, outwards. Null where the profile leaves the crop. */
function gradients({ x, y, width, height, rgba, place }: Crop, places: number, rayAt: (s: number) => readonly [number, number]): Float32Array | null {
  const colours = new Float32Array((places + 2) * 3);
  for (let s = -1; s <= places; ++s) {
    const [px, py] = place(...rayAt(s));
    const [cx, cy] = [px - x, py - y];
    const [column, row] = [Math.floor(cx), Math.floor(cy)];
    if (!(column >= 0 && row >= 0 && column < width - 1 && row < height - 1)) return null;
    const [fx, fy] = [cx - column, cy - row];
    for (let c = 0; c < 3; ++c) {
      const at = (row * width + column) * 4 + c;
      const [top, bottom] = [rgba[at]! + fx * (rgba[at + 4]! - rgba[at]!), rgba[at + 4 * width]! + fx * (rgba[at + 4 * width + 4]! - rgba[at + 4 * width]!)];
      colours[(s + 1) * 3 + c] = top + fy * (bottom - top);
    }
  }
  const out = new Float32Array(places * 3);
  for (let i = 0; i < out.length; ++i) out[i] = (colours[i + 6]! - colours[i]!) / (2 * kFine);
  return out;
}

/** In places of a profile; the line through all of them. */
interface Line {
  at: number; // at the middle profile
  slope: number; // a profile
}

/** Edges add up along a line that follows them. */
function innermost(profiles: Float32Array[], places: number, drift: number, isPossible: (line: Line) => boolean): Line | null {
  const half = (profiles.length - 1) / 2;
  const slopes = Math.ceil(drift) * 2 + 1;
  const strengths = Array.from({ length: slopes }, (_, k) => {
    const slope = (k - (slopes - 1) / 2) / (2 * half);
    return { slope, sums: strength(profiles, places, slope) };
  });
  const found: { line: Line; strength: number }[] = [];
  for (let s = 2; s < places - 2; ++s) {
    for (const [k, { slope, sums }] of strengths.entries()) {
      const here = sums[s]!;
      if (here < kContrast) continue;
      const isPeak = [-1, 0, 1].every((dk) => [-2, -1, 0, 1, 2].every((ds) => !((strengths[k + dk]?.sums[s + ds] ?? 0) > here)));
      if (isPeak && isPossible({ at: s, slope })) found.push({ line: { at: s, slope }, strength: here });
    }
  }
  const most = Math.max(...found.map((one) => one.strength));
  return found.find((one) => one.strength >= kFirst * most)?.line ?? null;
}

/** Of the mean change along lines of this slope. */
function strength(profiles: Float32Array[], places: number, slope: number): Float32Array {
  const half = (profiles.length - 1) / 2;
  const sums = new Float32Array(places * 3);
  const counts = new Uint16Array(places);
  for (const [i, profile] of profiles.entries()) {
    const shift = Math.round(slope * (i - half));
    for (let s = Math.max(0, -shift); s < Math.min(places, places - shift); ++s) {
      const from = (s + shift) * 3;
      sums[3 * s] = sums[3 * s]! + profile[from]!;
      sums[3 * s + 1] = sums[3 * s + 1]! + profile[from + 1]!;
      sums[3 * s + 2] = sums[3 * s + 2]! + profile[from + 2]!;
      counts[s] = counts[s]! + 1;
    }
  }
  const out = new Float32Array(places);
  for (let s = 0; s < places; ++s) {
    if (counts[s]! < 0.7 * profiles.length) continue;
    out[s] = Math.hypot(sums[3 * s]!, sums[3 * s + 1]!, sums[3 * s + 2]!) / counts[s]!;
  }
  return out;
}

interface Fitted extends Line {
  varianceAt: number;
  varianceSlope: number;
}

/** Where groups of profiles have their edge near the line, and the line through those, whatever some of them say. */
function follow(profiles: Float32Array[], places: number, start: Line): Fitted | null {
  let line = start;
  let ends: End[] = [];
  for (let round = 0; round < kRounds; ++round) {
    const axis = colourOf(profiles, line);
    const all = changeAlong(profiles, places, line, axis, 0, profiles.length);
    const wide = widthOf(all);
    if (wide === null) return null;
    const groups = Math.min(kGroups, Math.floor(profiles.length / kLeastOfGroup));
    ends = [];
    for (let g = 0; g < groups; ++g) {
      const [from, to] = [Math.floor((g * profiles.length) / groups), Math.floor(((g + 1) * profiles.length) / groups)];
      const by = middleOf(changeAlong(profiles, places, line, axis, from, to), wide);
      const t = (from + to - profiles.length) / 2;
      if (by !== null) ends.push({ t, s: line.at + line.slope * t + by });
    }
    const fitted = throughMost(ends);
    if (fitted === null) return null;
    line = fitted;
  }
  const kept = keptOf(ends, line);
  const n = kept.length;
  const t0 = kept.reduce((sum, { t }) => sum + t, 0) / n;
  const tt = kept.reduce((sum, { t }) => sum + (t - t0) ** 2, 0);
  if (n < 3 || !(tt > 0)) return null;
  const left = kept.reduce((sum, { t, s }) => sum + (s - line.at - line.slope * t) ** 2, 0) / (n - 2);
  const single = Math.max(left, (kLeastSingle / kFine) ** 2);
  return { ...line, varianceAt: single / n, varianceSlope: single / tt };
}

/** Which way the colour changes across the line, as a unit vector. */
function colourOf(profiles: Float32Array[], line: Line): [number, number, number] {
  const half = (profiles.length - 1) / 2;
  const sum: [number, number, number] = [0, 0, 0];
  for (const [i, profile] of profiles.entries()) {
    const s = Math.round(line.at + line.slope * (i - half));
    for (let c = 0; c < 3; ++c) sum[c] = sum[c]! + (profile[3 * s + c] ?? 0);
  }
  const size = Math.hypot(...sum) || 1;
  return [sum[0] / size, sum[1] / size, sum[2] / size];
}

const kAround = 5; // pixels to either side of the line

/** The mean change of these profiles, by how far from the line, from -kAround to kAround. */
function changeAlong(profiles: Float32Array[], places: number, line: Line, axis: readonly [number, number, number], from: number, to: number): Float32Array {
  const half = (profiles.length - 1) / 2;
  const around = kAround / kFine;
  const sums = new Float32Array(2 * around + 1);
  for (let i = from; i < to; ++i) {
    const profile = profiles[i]!;
    const at = line.at + line.slope * (i - half);
    const whole = Math.floor(at);
    const share = at - whole;
    for (let k = -around; k <= around; ++k) {
      const s = whole + k;
      if (s < 0 || s + 1 >= places) continue;
      let change = 0;
      for (let c = 0; c < 3; ++c) change += axis[c]! * ((1 - share) * profile[3 * s + c]! + share * profile[3 * s + 3 + c]!);
      sums[k + around] = sums[k + around]! + change / (to - from);
    }
  }
  return sums;
}

/** Half the width, in places, that the edge has to itself; null: there is none. */
function widthOf(change: Float32Array): number | null {
  const middle = (change.length - 1) / 2;
  let peak = middle;
  for (let k = -3; k <= 3; ++k) if (change[middle + k]! > change[peak]!) peak = middle + k;
  const most = change[peak]!;
  if (!(most > kContrast / 2)) return null;
  const reach = (way: number): { wide: number; other: boolean } => {
    let least = most;
    for (let k = 1; ; ++k) {
      const at = change[peak + way * k];
      if (at === undefined || at < kFoot * most) return { wide: k, other: false };
      if (at > least + kRise * most) return { wide: Math.max(1, k - 1), other: true }; // of the next edge
      least = Math.min(least, at);
    }
  };
  const [inner, outer] = [reach(-1), reach(1)];
  const wide = inner.other || outer.other ? Math.min(inner.wide, outer.wide) : Math.max(inner.wide, outer.wide);
  return Math.max(1 / kFine, wide);
}

/** By how many places the middle of the change is off the line; null where there is no change. */
function middleOf(change: Float32Array, wide: number): number | null {
  const middle = (change.length - 1) / 2;
  let at = middle;
  for (let round = 0; round < 8; ++round) {
    let [sum, moment] = [0, 0];
    for (let s = Math.max(0, Math.ceil(at - wide)); s <= Math.min(change.length - 1, at + wide); ++s) {
      // Those at the ends count by how much of them is within.
      const share = Math.min(1, s - (at - wide), at + wide - s);
      sum += share * change[s]!;
      moment += share * change[s]! * s;
    }
    if (!(sum > kContrast / 2)) return null;
    at = moment / sum;
    if (Math.abs(at - middle) > 2 / kFine) return null;
  }
  return at - middle;
}

interface End {
  t: number; // the profile, from the middle one
  s: number; // its edge, places
}

function fit(ends: readonly End[]): Line | null {
  const n = ends.length;
  let [t, s, tt, ts] = [0, 0, 0, 0];
  for (const end of ends) {
    t += end.t;
    s += end.s;
    tt += end.t * end.t;
    ts += end.t * end.s;
  }
  const det = n * tt - t * t;
  if (!(det > 0)) return null;
  const slope = (n * ts - t * s) / det;
  return { slope, at: (s - slope * t) / n };
}

function keptOf(ends: readonly End[], line: Line): End[] {
  const off = ({ t, s }: End): number => Math.abs(s - line.at - line.slope * t);
  const all = ends.map(off).sort((a, b) => a - b);
  const limit = Math.max(0.25 / kFine, kCut * 1.4826 * all[all.length >> 1]!);
  return ends.filter((end) => off(end) <= limit);
}

function throughMost(ends: readonly End[]): Line | null {
  let line = fit(ends);
  for (let round = 0; line !== null && round < 6; ++round) {
    const kept = keptOf(ends, line);
    if (kept.length < 3) return null;
    line = fit(kept);
  }
  return line;
}
