// SPDX-License-Identifier: Apache-2.0
// Proves: scales are of round steps, stay while they serve, and their colours run from one end to the other.
import { describe, expect, it } from 'vitest';
import { depthColour, metres, niceStep, steadyRange, ticks } from '../src/palette';

describe('steps', () => {
  it.each([[1, 10, 0.1], [1.2, 10, 0.2], [0.9, 12, 0.1], [3.1, 6, 1], [0.0023, 5, 0.0005], [700, 6, 200]])(
    'of %d, at most %d: %d',
    (length, most, step) => expect(niceStep(length, most)).toBeCloseTo(step, 9),
  );

  it('lie at multiples', () => {
    expect(ticks({ from: 0.85, to: 1.3 }, 0.1).map((v) => metres(v, 0.1))).toEqual(['0.9', '1.0', '1.1', '1.2', '1.3']);
    expect(metres(-0.0000001, 0.1)).toBe('0.0');
    expect(metres(0.015, 0.005)).toBe('0.015');
  });
});

describe('steadyRange', () => {
  it('holds everything, in whole steps', () => {
    expect(steadyRange(0.863, 1.254, null)).toEqual({ from: expect.closeTo(0.85, 9), to: expect.closeTo(1.3, 9) });
  });
  it('stays while it serves', () => {
    const range = steadyRange(0.863, 1.254, null);
    expect(steadyRange(0.87, 1.29, range)).toBe(range);
    expect(steadyRange(0.7, 1.29, range)).not.toBe(range);
    expect(steadyRange(0.9, 1.0, range)).not.toBe(range);
  });
  it('is no point', () => {
    const { from, to } = steadyRange(1, 1, null);
    expect(to).toBeGreaterThan(from);
  });
});

describe('depthColour', () => {
  it('runs from yellow to violet and stops there', () => {
    expect(depthColour(0)).toEqual([253, 231, 37]);
    expect(depthColour(1)).toEqual([68, 1, 84]);
    expect(depthColour(-3)).toEqual(depthColour(0));
    expect(depthColour(7)).toEqual(depthColour(1));
  });
});
