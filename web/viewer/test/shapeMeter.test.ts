// SPDX-License-Identifier: Apache-2.0
// Proves: what a flat surface is off, expects, and moves by from frame to frame is told as it was made; regions.
import { describe, expect, it } from 'vitest';
import type { Lens } from '../src/lens';
import type { Surface } from '../src/pick';
import { middleRegion, parseRegion, regionBetween, regionText } from '../src/region';
import { fullOf, isDoubtful, reportJson, ShapeMeter } from '../src/shapeMeter';

const lens: Lens = { width: 100, height: 80, fx: 100, skew: 0, cx: 49.5, fy: 100, cy: 39.5, distortion: [0.01, 0, 0, 0, 0] };

/** A wall a metre away, a vertex every second pixel, `by(column, row)` farther than that. */
function wall(by: (column: number, row: number) => number, sigma = 1e-4): Surface {
  const [columns, rows] = [48, 38];
  const positions = new Float32Array(3 * columns * rows);
  const triangles: number[] = [];
  for (let r = 0; r < rows; ++r) {
    for (let c = 0; c < columns; ++c) {
      const v = r * columns + c;
      const z = 1 + by(c, r);
      positions.set([((2 * c + 2 - lens.cx) / lens.fx) * z, ((2 * r + 2 - lens.cy) / lens.fy) * z, z], 3 * v);
      if (c > 0 && r > 0) triangles.push(v - columns - 1, v - columns, v, v - columns - 1, v, v - 1);
    }
  }
  const quality = { sigmas: new Float32Array(columns * rows).fill(sigma), interpolated: new Uint8Array(columns * rows) };
  return { positions, coordinates: null, triangles: Uint32Array.from(triangles), quality };
}
const region = { column: 20, row: 16, width: 60, height: 48 };

describe('ShapeMeter', () => {
  it('tells a checkered error, and what is expected', () => {
    const meter = new ShapeMeter(lens, region, 'plane');
    meter.add(wall((c, r) => ((c + r) % 2 === 0 ? 1e-4 : -1e-4)));
    const report = meter.report()!;
    expect(report).toMatchObject({ frames: 1, withoutShape: 0, filled: 1, noise: null });
    expect(report.points.median).toBe(30 * 24);
    expect(report.rms.median).toBeCloseTo(1e-4, 6);
    expect(report.span.median).toBeCloseTo(2e-4, 6);
    expect(report.expected!.median).toBeCloseTo(1e-4, 8);
    expect(report.off.median).toBe(0);
    expect(report.size.median).toBeCloseTo(1, 6);
    expect(report.tilt.median).toBeLessThan(0.01);
  });

  it('tells form from noise', () => {
    const meter = new ShapeMeter(lens, region, 'plane');
    const step = (c: number): number => (c % 8 < 4 ? 1e-4 : -1e-4); // stays
    for (let frame = 0; frame < 40; ++frame) meter.add(wall((c) => step(c) + (frame % 2 === 0 ? 2e-4 : -2e-4)));
    const report = meter.report()!;
    expect(report.frames).toBe(30); // the last ones
    expect(report.size.deviation).toBeCloseTo(2e-4, 5);
    expect(report.noise!).toBeCloseTo(2e-4 * Math.sqrt(30 / 29), 6);
    expect(report.form).toBeGreaterThan(0.7e-4);
    expect(report.form).toBeLessThan(1e-4);
  });

  it('does not change its mind from frame to frame about what is doubtful', () => {
    const off = (median: number, frames: number): Parameters<typeof isDoubtful>[0] => ({ off: { median, deviation: 0 }, frames });
    let doubtful = false;
    const told = [0.19, 0.21, 0.19, 0.2, 0.16, 0.14, 0.19].map((share) => (doubtful = isDoubtful(off(share, 30), doubtful)));
    expect(told).toEqual([false, true, true, true, true, false, false]);
    expect(isDoubtful(off(0.19, 1), true)).toBe(false); // of one frame alone nothing was before
  });

  it('draws red what is before the shape, blue what is behind', () => {
    const meter = new ShapeMeter(lens, region, 'plane');
    meter.add(wall((c, r) => (c > 10 && c < 16 && r > 14 && r < 20 ? -5e-3 : c > 30 && c < 36 && r > 14 && r < 20 ? 5e-3 : 0)));
    const rgba = meter.picture(fullOf({ ...meter.report()!, form: 1e-3 }));
    const at = (column: number, row: number): number[] => [...rgba.subarray(4 * ((row - region.row) * region.width + column - region.column)).subarray(0, 4)];
    expect(at(28, 36)).toEqual([255, 0, 0, 255]);
    expect(at(68, 36)).toEqual([0, 0, 255, 255]);
    expect(at(48, 36)).toEqual([255, 255, 255, 255]);
  });

  it('leaves out what is interpolated, and says where there is no shape', () => {
    const meter = new ShapeMeter(lens, region, 'plane');
    const surface = wall(() => 0);
    surface.quality!.interpolated.fill(1);
    meter.add(surface);
    expect(meter.report()).toBeNull();
    meter.add(wall(() => 0));
    expect(meter.report()).toMatchObject({ frames: 1, withoutShape: 1 });
    meter.add(surface, true); // instead of that
    expect(meter.report()).toBeNull();
  });

  it('says nothing is expected where a deviation is not known', () => {
    const meter = new ShapeMeter(lens, region, 'plane');
    meter.add(wall(() => 0, 0));
    expect(reportJson(meter.report()!, meter)).toMatchObject({ shape: 'plane', region: [20, 16, 60, 48], expected_mm: null, noise_mm: null });
  });
});

describe('regions', () => {
  it('are read as the command reads them', () => {
    expect(parseRegion('20,16, 60,48', lens)).toEqual(region);
    expect(parseRegion(regionText(region), lens)).toEqual(region);
    for (const text of ['', '1,2,3', '0,0,0,5', '41,0,60,5', 'a,b,c,d', '1,2,3,4,5', '-1,2,3,4']) expect(parseRegion(text, lens)).toBeNull();
    expect(middleRegion({ width: 641, height: 480 })).toEqual({ column: 192, row: 144, width: 256, height: 192 });
    expect(regionBetween([79.4, 63], [19.6, 16.2], lens)).toEqual(region);
    expect(regionBetween([-5, -5], [500, 500], lens)).toEqual({ column: 0, row: 0, width: 100, height: 80 });
  });
});
