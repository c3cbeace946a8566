// SPDX-License-Identifier: Apache-2.0
import { afterEach, describe, expect, it, vi } from 'vitest';
import { overlap, Overlay, placesOf } from '../src/overlay';
import type { Vec3 } from '../src/pick';

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

afterEach(() => vi.unstubAllGlobals());

it('dots are where they are said to be, not at the ends of a line', () => {
  const [arcs, corners]: [number[][], number[][]] = [[], []];
  const drawn: Record<string, unknown> = {
    arc: (x: number, y: number) => arcs.push([x, y]),
    moveTo: (x: number, y: number) => corners.push([x, y]),
    lineTo: (x: number, y: number) => corners.push([x, y]),
  };
  const context = new Proxy(drawn, { get: (of, name: string) => of[name] ?? (() => undefined), set: () => true });
  vi.stubGlobal('window', { devicePixelRatio: 1 });
  vi.stubGlobal('getComputedStyle', () => ({ getPropertyValue: () => 'red', fontSize: '11px' }));
  const overlay = new Overlay({ getContext: () => context, clientWidth: 100, clientHeight: 100 } as unknown as HTMLCanvasElement);
  const line: Vec3[] = [[10, 10, 1], [20, 12, 1], [30, 12, 1], [40, 10, 1], [50, 10, 1]];
  overlay.marks = () => [{ points: line, dots: [[8, 10, 1], [55, 10, 1], [70, 10, -1]], text: '' }];
  overlay.draw(([x, y, z]) => (z > 0 ? { x, y } : null), []);
  expect(arcs).toEqual([[8, 10], [55, 10]]);
  expect(corners).toEqual([...line, ...line].map(([x, y]) => [x, y])); // and its halo
});

it('text that would lie over other text stands elsewhere on its mark', () => {
  const texts: number[][] = [];
  const drawn: Record<string, unknown> = { fillText: (_: string, x: number, y: number) => texts.push([x, y]), measureText: () => ({ width: 30 }) };
  const context = new Proxy(drawn, { get: (of, name: string) => of[name] ?? (() => undefined), set: () => true });
  vi.stubGlobal('window', { devicePixelRatio: 1 });
  vi.stubGlobal('getComputedStyle', () => ({ getPropertyValue: () => 'red', fontSize: '11px' }));
  const overlay = new Overlay({ getContext: () => context, clientWidth: 400, clientHeight: 400 } as unknown as HTMLCanvasElement);
  const diagonals: Vec3[][] = [[[100, 100, 1], [300, 300, 1]], [[100, 300, 1], [300, 100, 1]], [[200, 100, 1], [200, 300, 1]]];
  overlay.marks = () => diagonals.map((points) => ({ points, dots: [], text: 'a length' }));
  overlay.draw(([x, y]) => ({ x, y }), []);
  expect(texts.length).toBe(3);
  for (const [i, [x, y]] of texts.entries()) {
    for (const [u, v] of texts.slice(i + 1)) expect(Math.abs(x! - u!) >= 30 || Math.abs(y! - v!) >= 11).toBe(true);
  }
  expect(placesOf([{ x: 0, y: 0 }, { x: 100, y: 0 }])[0]).toEqual({ x: 50, y: -14 });
});
