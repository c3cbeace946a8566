// SPDX-License-Identifier: Apache-2.0
// What was measured, as a link carries it: the places, and how exactly what they give is known, so that another page says the
// same of them. Any input. Pure.
//
//   measure=TOOL_SURFACE_RIG[_EYE]__PLACE[__PLACE...]   PLACE: STREAM_KIND_X_Y_Z_SIGMA[_MOTION]
//
// Metres and radians. SURFACE, RIG: both parts of the ±; SIGMA: of the place's depth; each x where it is not known. EYE: of a
// section, from where it was cut. STREAM: which of the link's. MOTION: of its camera's frame into that of the first place, six
// numbers of rigidOf(), where it is of another stream.
import { depthSigma, kKinds, kSpots, kTools, measure, together, type Kind, type Measurement, type Spot, type Tool } from './measure';
import type { Vec3 } from './pick';
import { parseRegion, regionText, type Region } from './region';
import { axisOf, combined, inverse, kNowhere, rigidOf, type Rigid } from './rigid';
import { kShapes, type ShapeKind } from './shape';

const kMost = 1e4; // metres
const kDigits = 9; // behind the point: more than are shown, so that what is shown is the same
const kSigmaDigits = 6;

export interface FlatRegion {
  readonly kind: ShapeKind;
  readonly region: Region | null; // null: the middle
}

const written = (numbers: readonly number[]): string[] => numbers.map((c) => String(Number(c.toFixed(kDigits))));
const sigmaText = (sigma: number | null): string => (sigma === null ? 'x' : String(Number(sigma.toPrecision(kSigmaDigits))));

/** `streams`: of the link. Null: one that was measured on is none of them. */
export function writeMeasurement({ tool, spots, surface, rig, eye }: Measurement, streams: readonly string[]): string | null {
  const [first] = spots;
  if (first === undefined || spots.some(({ stream }) => !streams.includes(stream))) return null;
  const places = spots.map((spot) => {
    const { rotation, translation }: Rigid = combined(inverse(first.pose), spot.pose);
    const motion = spot.stream === first.stream ? [] : [...axisOf({ rotation, translation }), ...translation];
    return [streams.indexOf(spot.stream), spot.kind, ...written(spot.point), sigmaText(depthSigma(spot)), ...written(motion)].join('_');
  });
  return [[tool, sigmaText(surface), sigmaText(rig), ...written(eye ?? [])].join('_'), ...places].join('__');
}

/** A section without its profile, which is cut from a surface. Null: it makes no sense. */
export function readMeasurement(text: string, streams: readonly string[]): Measurement | null {
  const [head, ...places] = text.split('__').map((part) => part.split('_'));
  const tool = kTools.find((name) => name === head![0]);
  const [surface, rig] = [readSigma(head![1]), readSigma(head![2])];
  const eye = readNumbers(head!.slice(3));
  if (tool === undefined || surface === undefined || rig === undefined || eye?.length !== (tool === 'section' ? 3 : 0)) return null;
  const spots = places.map((place) => readSpot(place, streams));
  if (spots.length !== kSpots[tool] || spots.includes(null)) return null;
  return restored(tool, spots as Spot[], surface, rig, eye as Vec3);
}

function restored(tool: Tool, spots: Spot[], surface: number | null, rig: number | null, eye: Vec3): Measurement | null {
  const [{ stream }] = spots as [Spot];
  if (tool === 'section' && spots.some((spot) => spot.stream !== stream)) return null;
  for (const spot of spots) if (spot.stream === stream) spot.pose = kNowhere;
  // Of the places' errors only depths are known, and what they come to together.
  const bare = spots.map((spot) => ({ ...spot, errors: null }));
  const measured = measure(tool, bare, null, eye);
  if (!Number.isFinite(measured.value)) return null;
  return { ...measured, spots, surface, rig, sigma: together(surface, rig) };
}

function readSpot([stream = '', kind, ...rest]: string[], streams: readonly string[]): Spot | null {
  const name = /^\d{1,3}$/.test(stream) ? streams[Number(stream)] : undefined;
  const [sigma, point, motion] = [readSigma(rest[3]), readNumbers(rest.slice(0, 3)), readNumbers(rest.slice(4))];
  const isKind = kKinds.includes(kind as Kind);
  if (name === undefined || !isKind || sigma === undefined || point?.length !== 3 || (motion?.length !== 0 && motion?.length !== 6)) return null;
  const pose = motion.length === 0 ? kNowhere : rigidOf(motion.slice(0, 3) as Vec3, motion.slice(3) as Vec3);
  return { point: point as Vec3, kind: kind as Kind, errors: sigma === null ? null : [[0, 0, sigma]], stream: name, pose, rig: null };
}

function readNumber(text: string | undefined): number | null {
  const value = /^-?\d+(\.\d+)?(e-?\d{1,3})?$/.test(text ?? '') ? Number(text) : NaN;
  return Math.abs(value) < kMost ? value : null;
}

function readNumbers(texts: readonly string[]): number[] | null {
  const numbers = texts.map(readNumber);
  return numbers.includes(null) ? null : (numbers as number[]);
}

/** Null: not known; undefined: it makes no sense. */
function readSigma(text: string | undefined): number | null | undefined {
  if (text === 'x') return null;
  const sigma = readNumber(text);
  return sigma === null || sigma < 0 ? undefined : sigma;
}

/** `flat=KIND[_COLUMN_ROW_WIDTH_HEIGHT]` of a link. */
export const writeFlatRegion = ({ kind, region }: FlatRegion): string =>
  [kind, ...(region === null ? [] : regionText(region).split(','))].join('_');

const kAnyCamera = { width: 1e5, height: 1e5 }; // which one it is, is known later

/** Null: it makes no sense. */
export function readFlatRegion(text: string): FlatRegion | null {
  const [given, ...numbers] = text.split('_');
  const kind = kShapes.find((name) => name === given);
  const region = numbers.length === 0 ? null : parseRegion(numbers.join(), kAnyCamera);
  return kind === undefined || (numbers.length > 0 && region === null) ? null : { kind, region };
}
