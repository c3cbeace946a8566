// SPDX-License-Identifier: Apache-2.0
import { describe, expect, it } from 'vitest';
import { Resolution } from '../src/resolution';

/** Drawings whose cost has a part that goes with the pixels. */
function settle(resolution: Resolution, fixed_ms: number, pixels_ms: number): number {
  let changes = 0;
  for (let i = 0; i < 200; ++i) {
    if (resolution.took(fixed_ms + pixels_ms * resolution.scale ** 2)) ++changes;
  }
  return changes;
}

describe('Resolution', () => {
  it('stays full where drawing is quick', () => {
    const resolution = new Resolution();
    expect(settle(resolution, 2, 6)).toBe(0);
    expect(resolution.scale).toBe(1);
  });
  it('falls until drawing keeps up, and stays there', () => {
    const resolution = new Resolution();
    settle(resolution, 5, 30);
    expect(5 + 30 * resolution.scale ** 2).toBeLessThan(22);
    expect(resolution.scale).toBeGreaterThan(0.5);
    expect(settle(resolution, 5, 30)).toBe(0);
  });
  it('has a floor', () => {
    const resolution = new Resolution();
    settle(resolution, 50, 500);
    expect(resolution.scale).toBe(0.5);
  });
  it('falls at once where each drawing takes seconds', () => {
    const resolution = new Resolution();
    let passed_ms = 0;
    for (let i = 0; resolution.scale > 0.5 && i < 100; ++i) {
      const ms = 4000 * resolution.scale ** 2;
      passed_ms += ms;
      resolution.took(ms);
    }
    expect(passed_ms).toBeLessThan(13_000);
  });
  it('rises again', () => {
    const resolution = new Resolution();
    settle(resolution, 5, 60);
    settle(resolution, 1, 5);
    expect(resolution.scale).toBe(1);
  });
  it('one slow drawing changes nothing', () => {
    const resolution = new Resolution();
    expect(resolution.took(900)).toBe(false);
    for (let i = 0; i < 20; ++i) resolution.took(12);
    expect(resolution.took(50)).toBe(false);
    expect(resolution.scale).toBe(1);
  });
});
