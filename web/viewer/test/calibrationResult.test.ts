// SPDX-License-Identifier: Apache-2.0
// Proves: what the page /rig says of a calibration's geometry first, and whether it is to be kept.
import { describe, expect, it } from 'vitest';
import type { GeometryResult } from '../src/rig/calibration';
import { isGood, verdictOf } from '../src/rig/calibrationResult';

const kGood: GeometryResult = {
  stereo_rms_px: 0.1,
  stereo_rms_all_corners_px: 0.4,
  plane_rms_mm: 0.1,
  square_error_mm: 0.05,
  baseline_mm: 200,
  distance_m: 1,
  depth_sigma_mm: 0.3,
  views: [],
};

describe('the result of a geometry', () => {
  it('is good where all fits', () => {
    expect(isGood(kGood)).toBe(true);
    expect(verdictOf(kGood)).toMatch(/good/);
  });

  it('is not where corners that were left out are far off, as relievo-server calibrate warns', () => {
    const result = { ...kGood, stereo_rms_all_corners_px: 12.34 };
    expect(isGood(result)).toBe(false);
    expect(verdictOf(result)).toMatch(/12\.3 px.*projector/);
  });

  it('says first what matters most', () => {
    const poor = { ...kGood, depth_sigma_mm: 3 };
    expect(verdictOf(poor)).toMatch(/Not exact yet/);
    expect(verdictOf({ ...poor, stereo_rms_all_corners_px: 9 })).toMatch(/left out/);
    expect(verdictOf({ ...poor, stereo_rms_all_corners_px: 9, stereo_rms_px: 2 })).toMatch(/board flat/);
    for (const result of [poor, { ...kGood, stereo_rms_px: 2 }]) expect(isGood(result)).toBe(false);
  });
});
