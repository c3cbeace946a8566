// SPDX-License-Identifier: Apache-2.0
// Proves: who opens a link reads the figures of who sent it, with their errors; what makes no sense in one is left out.
import { describe, expect, it } from 'vitest';
import { alongRay, measure, measurementsCsv, valueText, type Measurement, type Spot, type Tool } from '../src/measure';
import type { Surface, Vec3 } from '../src/pick';
import type { RigError } from '../src/rigError';
import { kNowhere, rigidOf, toTheRight, type Rigid } from '../src/rigid';
import { readFlatRegion, readMeasurement, writeFlatRegion, writeMeasurement } from '../src/shareMeasure';

const rig: RigError = { scale: 0.002, camera: 3e-4, projector: 4e-4, centre: [0.2, 0, 0.01] };
const spot = (point: Vec3, other: Partial<Spot> = {}): Spot => ({
  point, kind: 'surface', errors: alongRay(point, 1.234567e-4), stream: 'face', pose: kNowhere, rig, ...other,
});
const a: Vec3 = [0.0123456789, -0.0333333333, 0.9876543211];
const b: Vec3 = [-0.0777777777, 0.0222222222, 1.0123456789];
const c: Vec3 = [0.1, 0.0499999999, 0.95];
const sheet: Surface = {
  positions: new Float32Array([-1, -1, 1, 1, -1, 1, 1, 1, 1, -1, 1, 1]),
  coordinates: null,
  triangles: new Uint32Array([0, 1, 2, 0, 2, 3]),
  quality: null,
};
const streams = ['vase', 'face', 'left_one'];
const written = (m: Measurement): string => writeMeasurement(m, streams)!;
const back = (m: Measurement): Measurement => readMeasurement(written(m), streams)!;
const corner = spot(b, { kind: 'corner', errors: [[1e-4, 0, 2e-4], [0, 3e-5, -1e-4], [0, 0, 5e-5]] });
const figures = (m: Measurement): string[] => [valueText(m), valueText({ ...m, sigma: m.surface }), valueText({ ...m, sigma: m.rig })];

describe('a measurement of a link', () => {
  const cases: [Tool, Spot[]][] = [
    ['point', [spot(a)]],
    ['distance', [spot(a), corner]],
    ['angle', [spot(a), spot(b, { kind: 'edge' }), spot(c)]],
    ['section', [spot(a), spot(c)]],
  ];

  it.each(cases)('says what was read, and how exactly: %s', (tool, spots) => {
    const m = measure(tool, spots, sheet, [0.1, 0.2, -0.3]);
    const other = back(m);
    expect(figures(other)).toEqual(figures(m));
    expect(other.spots.map(({ kind, stream }) => [kind, stream])).toEqual(m.spots.map(({ kind, stream }) => [kind, stream]));
    expect(other.eye).toEqual(m.eye);
    // The table, too, to a nanometre.
    const numbers = (of: Measurement): string[] => measurementsCsv([of]).split('\n')[1]!.split(',').map((cell) => (Number(cell) ? Number(cell).toPrecision(4) : cell));
    expect(numbers(other)).toEqual(numbers(m));
  });

  it('says that nothing is known of an error where nothing is', () => {
    const known = measure('distance', [spot(a, { errors: null }), spot(b)], null, [0, 0, 0]);
    expect(known.surface).toBeNull();
    expect(figures(back(known))).toEqual(figures(known));
    const unknown = measure('distance', [spot(a, { errors: null, rig: null }), spot(b, { rig: null })], null, [0, 0, 0]);
    expect(back(unknown).sigma).toBeNull();
  });

  it('is of the streams as they stood', () => {
    const stands: Rigid = rigidOf([0.1, -0.7, 0.05], [0.8, -0.01, 0.25]);
    const m = measure('distance', [spot(a, { pose: toTheRight(0.5) }), spot(b, { stream: 'left_one', pose: stands })], null, [0, 0, 0]);
    expect(figures(back(m))).toEqual(figures(m));
    expect(back(m).spots[1]!.stream).toBe('left_one');
    expect(writeMeasurement(m, ['face'])).toBeNull();
  });

  it('is short', () => {
    expect(written(measure('distance', [spot(a), corner], null, [0, 0, 0])).length).toBeLessThan(160);
  });

  const good = 'distance_0.0001_x__1_surface_0.1_0.2_1_0.0001__1_corner_0.2_0.2_1_x';
  it('is read as it is written down', () => {
    const m = readMeasurement(good, streams)!;
    expect(m.value).toBeCloseTo(0.1, 12);
    expect([m.sigma, m.surface, m.rig]).toEqual([0.0001, 0.0001, null]);
  });

  it.each([
    '', '__', 'distance', good.replace('distance', 'constructor'), good.replace('distance', 'angle'), good.replace('distance', 'section'),
    good.replace('0.0001_x__', '-1_x__'), good.replace('0.0001_x__', 'NaN_x__'), good.replace('0.0001_x__', '0.0001__'), good.replace('0.0001_x__', '1e999_x__'),
    good.replace('0.0001_x__', '0.0001_x_1__'), good.replace('0.0001_x__', '0.0001_x_0_0_0__'), good.replace('1_surface', '3_surface'), good.replace('1_surface', '-1_surface'),
    good.replace('1_surface', 'length_surface'), good.replace('surface', 'toString'), good.replace('_0.1_', '_0x1_'), good.replace('_0.1_', '_1e5_'),
    good.replace('_0.1_', '_Infinity_'), good.replace('_0.1_', '_ 1_'), `${good}_1`, `${good}_0_0_0_0_0`, `${good}__${good}`, good.split('__').slice(0, 2).join('__'),
    'angle_x_x__0_surface_0_0_1e99_x__0_surface_0_0_1_x__0_surface_0_1_1_x', 'section_x_x_0_0_0__0_surface_0_0_1_x__1_surface_0_1_1_x',
  ])('that makes no sense is none: %s', (text) => expect(readMeasurement(text, streams)).toBeNull());

  it('of places at one point is finite', () => {
    const m = readMeasurement('angle_x_x__0_surface_0_0_1_x__0_surface_0_0_1_x__0_surface_0_0_1_x', streams);
    expect(m === null || Number.isFinite(m.value)).toBe(true);
  });
});

describe("Flatness' region of a link", () => {
  it.each([{ kind: 'plane', region: null }, { kind: 'sphere', region: { column: 10, row: 20, width: 300, height: 40 } }] as const)('comes back', (of) =>
    expect(readFlatRegion(writeFlatRegion(of))).toEqual(of),
  );
  it.each(['', 'cube', 'plane_', 'plane_1_2_3', 'plane_1_2_3_4_5', 'plane_1_2_0_4', 'plane_-1_2_3_4', 'plane_1_2_3_4e3', 'toString_1_2_3_4'])(
    'that makes no sense is none: %s',
    (text) => expect(readFlatRegion(text)).toBeNull(),
  );
});
