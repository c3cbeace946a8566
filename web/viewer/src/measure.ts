// SPDX-License-Identifier: Apache-2.0
// Lengths, angles and cross-sections on surfaces, with their standard deviations. Pure; metres, places in the frames of
// their own rigs' cameras. An error of depth moves a vertex along its ray from its rig's camera; the errors of two places
// are independent, but for that of the rig's scale, which all places of a stream share.
import type { Mark } from './overlay';
import type { Surface, Vec3 } from './pick';
import { rigDepthError, type RigError } from './rigError';
import { moved, type Rigid } from './rigid';

export const kTools = ['point', 'distance', 'angle', 'section'] as const;
export type Tool = (typeof kTools)[number];

/** How many places a tool needs. */
export const kSpots: Record<Tool, number> = { point: 1, distance: 2, angle: 3, section: 2 };

/** What of a surface a place is on; edges and corners are fitted to what is around (snap.ts). */
export const kKinds = ['surface', 'edge', 'corner'] as const;
export type Kind = (typeof kKinds)[number];

export interface Spot {
  point: Vec3;
  kind: Kind;
  errors: readonly Vec3[] | null; // independent of each other, each of one standard deviation; metres; null: not known
  stream: string; // whose camera's frame it is in
  pose: Rigid; // of that frame in one that all spots of a measurement share
  rig: RigError | null; // of that stream; null: not known
}

export interface Measurement {
  tool: Tool;
  spots: Spot[];
  value: number; // point: depth; distance, section: length; metres. Angle at the second spot: radians
  sigma: number | null; // of both parts, or of the one that is known
  surface: number | null; // its part from the spots' own sigmas
  rig: number | null; // its part from the rigs
  profile: Segment[]; // of a section
  eye: Vec3 | null; // from where that was cut, in its camera's frame
}

const minus = (a: Vec3, b: Vec3): Vec3 => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a: Vec3, b: Vec3): Vec3 => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
const length = (a: Vec3): number => Math.sqrt(dot(a, a));
const unit = (a: Vec3): Vec3 => {
  const size = length(a);
  return [a[0] / size, a[1] / size, a[2] / size];
};

/** The error of a vertex or a place between some: of its depth, along its ray. */
export const alongRay = (point: Vec3, sigma: number): Vec3[] => [point.map((c) => (c * sigma) / point[2]) as Vec3];

/** Of a place's depth. */
export const depthSigma = ({ errors }: Pick<Spot, 'errors'>): number | null =>
  errors === null ? null : Math.hypot(...errors.map(([, , z]) => z));

/** Of places in one frame, but for a depth, which is of its own camera's. */
const values: Record<Tool, (points: Vec3[]) => number> = {
  point: ([a]) => a![2],
  distance: ([a, b]) => length(minus(a!, b!)),
  section: ([a, b]) => length(minus(a!, b!)),
  angle: ([a, b, c]) => {
    const [u, v] = [minus(a!, b!), minus(c!, b!)];
    return Math.atan2(length(cross(u, v)), dot(u, v));
  },
};

/** `surface`, of the spots of a section; `eye`: from where its line was drawn, in their camera's frame. */
export function measure(tool: Tool, spots: Spot[], surface: Surface | null, eye: Vec3): Measurement {
  const points = spots.map((s) => s.point);
  const inOneFrame = (points: Vec3[]): Vec3[] => (tool === 'point' ? points : points.map((p, i) => moved(spots[i]!.pose, p)));
  const value = (points: Vec3[]): number => values[tool](inOneFrame(points));
  const alone = (i: number, error: Vec3): Moving => points.map((_, j) => (j === i ? error : null));
  const own = spots.some(({ errors }) => errors === null)
    ? null
    : propagate(value, points, spots.flatMap(({ errors }, i) => errors!.map((error) => alone(i, error))));
  const rig = spots.some((spot) => spot.rig === null)
    ? null
    : propagate(value, points, [
        ...spots.map(({ rig, point }, i) => alone(i, alongRay(point, rigDepthError(rig!, point))[0]!)),
        ...spots
          .filter(({ stream }, i) => spots.findIndex((s) => s.stream === stream) === i)
          .map(({ rig, stream }): Moving => spots.map((s) => (s.stream === stream ? (s.point.map((c) => c * rig!.scale) as Vec3) : null))),
      ]);
  return {
    tool,
    spots,
    value: value(points),
    sigma: together(own, rig),
    surface: own,
    rig,
    profile: tool === 'section' && surface !== null ? section(surface, points[0]!, points[1]!, eye, spots[0]!.rig) : [],
    eye: tool === 'section' ? eye : null,
  };
}

/**
 * What is drawn of a measurement: its spots, which a section's line may miss, and the line. `poses` of the spots' cameras
 * in the scene.
 */
export function markOf({ spots, profile }: Pick<Measurement, 'spots' | 'profile'>, poses: readonly Rigid[], text: string): Mark {
  const dots = spots.map(({ point }, i) => moved(poses[i]!, point));
  const path = profile.flatMap(([a, b]) => [moved(poses[0]!, a.point), moved(poses[0]!, b.point)]);
  return { points: path.length > 0 ? path : dots, dots, text };
}

/** Both parts, independent of each other; null: neither is known. */
export const together = (surface: number | null, rig: number | null): number | null =>
  surface === null && rig === null ? null : Math.hypot(surface ?? 0, rig ?? 0);

// An error of one standard deviation: by what it moves each of the places; null: not at all.
type Moving = readonly (Vec3 | null)[];

// By central differences.
function propagate(value: (points: Vec3[]) => number, points: Vec3[], errors: readonly Moving[]): number {
  let variance = 0;
  for (const moves of errors) {
    const most = Math.max(...moves.map((by, i) => (by === null ? 0 : length(by) / length(points[i]!))));
    if (most === 0) continue;
    const step = 1e-4 / most; // of the error
    const off = (by: number): number => value(points.map((p, i) => p.map((c, k) => c + by * (moves[i]?.[k] ?? 0)) as Vec3));
    variance += ((off(step) - off(-step)) / (2 * step)) ** 2;
  }
  return Math.sqrt(variance);
}

export interface ProfilePoint {
  along: number; // metres from the first place towards the second
  height: number; // metres off the straight line, towards the eye
  sigma: number | null; // of the height
  point: Vec3;
}
export type Segment = readonly [ProfilePoint, ProfilePoint];

/** Where the plane through `eye` and both places cuts the surface, between the places, as far as the eye sees it. */
export function section(surface: Surface, a: Vec3, b: Vec3, eye: Vec3, rig: RigError | null): Segment[] {
  const { positions: p, triangles } = surface;
  const along = unit(minus(b, a));
  const normal = unit(cross(minus(a, eye), minus(b, eye)));
  let up = cross(normal, along);
  if (dot(up, minus(eye, a)) < 0) up = [-up[0], -up[1], -up[2]];
  const end = length(minus(b, a));
  const side = new Float64Array(p.length / 3);
  for (let v = 0; v < side.length; ++v) {
    side[v] = (p[3 * v]! - a[0]) * normal[0] + (p[3 * v + 1]! - a[1]) * normal[1] + (p[3 * v + 2]! - a[2]) * normal[2];
  }
  const cut = (v: number, w: number): ProfilePoint => {
    const t = side[v]! / (side[v]! - side[w]!);
    const point = [0, 1, 2].map((i) => p[3 * v + i]! + t * (p[3 * w + i]! - p[3 * v + i]!)) as Vec3;
    const off = minus(point, a);
    const ray: Vec3 = [point[0] / point[2], point[1] / point[2], 1];
    const height = dot(off, up);
    const s = together(sigmaBetween(surface, v, w, t), rig && rigDepthError(rig, point));
    const sigma = s === null ? null : Math.hypot(dot(ray, up) * s, height * (rig?.scale ?? 0));
    return { along: dot(off, along), height, sigma, point };
  };
  const segments: Segment[] = [];
  for (let t = 0; t < triangles.length; t += 3) {
    const corners = [triangles[t]!, triangles[t + 1]!, triangles[t + 2]!];
    const ends: ProfilePoint[] = [];
    for (let i = 0; i < 3; ++i) {
      const [v, w] = [corners[i]!, corners[(i + 1) % 3]!];
      if (side[v]! < 0 !== side[w]! < 0) ends.push(cut(v, w));
    }
    if (ends.length !== 2) continue;
    segments.push(ends[0]!.along <= ends[1]!.along ? [ends[0]!, ends[1]!] : [ends[1]!, ends[0]!]);
  }
  return seen(segments, [dot(minus(eye, a), along), dot(minus(eye, a), up)], end).sort((x, y) => x[0].along - y[0].along);
}

const kBehind = 0.01; // of its distance: what lies no farther behind another part may be the same surface's, by noise or a fold
const kBins = 512; // of the line

type Ray = readonly [number, number]; // from the eye, in the section's plane
const turn = ([px, py]: Ray, [qx, qy]: Ray): number => px * qy - py * qx; // from one to the other

/** Whether the ray to a place meets this piece before it. */
function isBefore([p, q]: readonly [Ray, Ray], [x, y]: Ray): boolean {
  const [off, offOther] = [turn(p, [x, y]), turn(q, [x, y])];
  if (off < 0 === offOther < 0) return false;
  const t = off / (off - offOther);
  const met = ((p[0] + t * (q[0] - p[0])) * x + (p[1] + t * (q[1] - p[1])) * y) / (x * x + y * y); // of the way
  return met > 0 && met < 1 - kBehind;
}

/**
 * Those that the eye sees, and sees between the places: what a ray through their middle meets first. The eye's place is
 * along the line, which is so long, and off it.
 */
function seen(segments: Segment[], [eyeAlong, eyeHeight]: readonly [number, number], length: number): Segment[] {
  const [first, last]: [Ray, Ray] = [[-eyeAlong, -eyeHeight], [length - eyeAlong, -eyeHeight]];
  const way = Math.sign(turn(first, last));
  /** By where its ray meets the line; -1 and kBins: before the first place, behind the second. */
  const binOf = (ray: Ray): number => {
    if (way * turn(first, ray) < 0) return -1;
    if (way * turn(ray, last) < 0) return kBins;
    return Math.min(kBins - 1, Math.floor(((eyeAlong - (ray[0] * eyeHeight) / ray[1]) / length) * kBins));
  };
  const rays = segments.map((ends) => ends.map(({ along, height }): Ray => [along - eyeAlong, height - eyeHeight]) as [Ray, Ray]);
  const reach = rays.map((ends): Ray => {
    const [a, b] = ends.map(binOf) as [number, number];
    return [Math.max(0, Math.min(a, b)), Math.min(kBins - 1, Math.max(a, b))]; // none where both are off on one side
  });
  const bins: [Ray, Ray][][] = Array.from({ length: kBins }, () => []);
  for (const [i, [least, most]] of reach.entries()) for (let bin = least; bin <= most; ++bin) bins[bin]!.push(rays[i]!);
  return segments.filter(([from, to], i) => {
    const [least, most] = reach[i]!;
    if (least > most || to.along < 0 || from.along > length) return false;
    const [[px, py], [qx, qy]] = rays[i]!;
    const middle: Ray = [(px + qx) / 2, (py + qy) / 2];
    return !bins[Math.min(most, Math.max(least, binOf(middle)))]!.some((other) => isBefore(other, middle));
  });
}

function sigmaBetween({ quality }: Surface, v: number, w: number, t: number): number | null {
  const [a, b] = [quality?.sigmas[v] ?? 0, quality?.sigmas[w] ?? 0];
  return a > 0 && b > 0 ? Math.hypot((1 - t) * a, t * b) : null;
}

/** "101.24 ± 0.31 mm": as many digits as are known. */
export function lengthText(value: number, sigma: number | null): string {
  const mm = value * 1000;
  if (sigma === null) return `${mm.toFixed(2)} mm`;
  const digits = Math.min(3, Math.max(0, 1 - Math.floor(Math.log10(Math.max(sigma * 1000, 1e-3)))));
  return `${mm.toFixed(digits)} ± ${(sigma * 1000).toFixed(digits)} mm`;
}

export function angleText(value: number, sigma: number | null): string {
  const degrees = (v: number): string => ((v * 180) / Math.PI).toFixed(2);
  return sigma === null ? `${degrees(value)}°` : `${degrees(value)} ± ${degrees(sigma)}°`;
}

export function valueText({ tool, value, sigma }: Measurement): string {
  return tool === 'angle' ? angleText(value, sigma) : lengthText(value, sigma);
}

const number = (value: number | null | undefined): string => (value === null || value === undefined ? '' : value.toPrecision(9));

/** A line a measurement; metres and radians, each place in the frame of its own stream's camera; the sigmas of places are their depths'. */
export function measurementsCsv(measurements: readonly Measurement[], separator = ','): string {
  const head = (i: number): string[] => [`x${i}_m`, `y${i}_m`, `z${i}_m`, `sigma${i}_m`, `kind${i}`, `stream${i}`];
  const lines = [['tool', 'value', 'unit', 'sigma', 'sigma_surface', 'sigma_rig', ...[1, 2, 3].flatMap(head)]];
  for (const m of measurements) {
    const spots = [0, 1, 2].flatMap((i) => {
      const s = m.spots[i];
      return s === undefined ? ['', '', '', '', '', ''] : [...s.point.map(number), number(depthSigma(s)), s.kind, s.stream];
    });
    lines.push([m.tool, number(m.value), m.tool === 'angle' ? 'rad' : 'm', number(m.sigma), number(m.surface), number(m.rig), ...spots]);
  }
  // A file of this device may be called anything.
  const cell = (text: string): string => (/[\t\n\r",]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  return lines.map((line) => `${line.map(cell).join(separator)}\n`).join('');
}

/** A line a point; an empty line where the surface has a gap. */
export function sectionCsv(profile: readonly Segment[]): string {
  const line = (p: ProfilePoint): string =>
    [p.along, p.height, p.sigma, ...p.point].map(number).join(',');
  const lines = ['along_m,height_m,sigma_m,x_m,y_m,z_m'];
  let last: ProfilePoint | null = null;
  for (const [from, to] of profile) {
    if (last === null || !isSame(last, from)) {
      if (last !== null) lines.push('');
      lines.push(line(from));
    }
    lines.push(line(to));
    last = to;
  }
  return `${lines.join('\n')}\n`;
}

const isSame = (a: ProfilePoint, b: ProfilePoint): boolean =>
  Math.abs(a.along - b.along) < 1e-9 && Math.abs(a.height - b.height) < 1e-9;
