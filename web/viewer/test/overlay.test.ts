// SPDX-License-Identifier: Apache-2.0
import { describe, expect, it } from 'vitest';
import { overlap } from '../src/overlay';

const box = (x: number, y: number): Parameters<typeof overlap>[0] => ({ x, y, width: 20, height: 10 });

describe('overlap', () => {
  it('is of boxes that share a place', () => {
    expect(overlap(box(0, 0), box(19, 9))).toBe(true);
    expect(overlap(box(0, 0), box(0, 0))).toBe(true);
  });
  it('is not of those that stand beside or below each other', () => {
    expect(overlap(box(0, 0), box(20, 0))).toBe(false);
    expect(overlap(box(0, 0), box(0, 10))).toBe(false);
  });
});
