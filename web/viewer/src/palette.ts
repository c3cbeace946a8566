// SPDX-License-Identifier: Apache-2.0
// Colours that stand for numbers, on the surface and in its legend. Pure.

export type Rgb = readonly [number, number, number]; // 0..255, sRGB

// Even steps of lightness, and distinct to eyes that do not tell red from green.
const kDepthStops: readonly Rgb[] = [
  [253, 231, 37],
  [160, 218, 57],
  [74, 193, 109],
  [31, 161, 135],
  [39, 127, 142],
  [54, 92, 141],
  [70, 50, 127],
  [68, 1, 84],
];

/** Of 0..1, IEC 61966-2-1. */
export const toSrgb = (linear: number): number =>
  Math.round(255 * (linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055));

/** 0 near (yellow) .. 1 far (violet). */
export function depthColour(share: number): Rgb {
  const at = Math.min(1, Math.max(0, share)) * (kDepthStops.length - 1);
  const i = Math.min(Math.floor(at), kDepthStops.length - 2);
  const mix = (c: 0 | 1 | 2): number => {
    const [from, to] = [kDepthStops[i]![c], kDepthStops[i + 1]![c]];
    return Math.round(from + (to - from) * (at - i));
  };
  return [mix(0), mix(1), mix(2)];
}

/** The step of 1, 2 or 5 times a power of ten of which at most `most` lie in `length` (> 0). */
export function niceStep(length: number, most: number): number {
  const least = length / most;
  const power = 10 ** Math.floor(Math.log10(least));
  const step = [1, 2, 5, 10].find((s) => s * power >= least * (1 - 1e-9)) ?? 10;
  return step * power;
}

export interface Range {
  from: number;
  to: number;
}

/** Of whole steps, so that colours stay while the surface moves a little; the old one while it still serves. */
export function steadyRange(from: number, to: number, old: Range | null): Range {
  const length = Math.max(to - from, 1e-4);
  const step = niceStep(length, 10);
  const serves =
    old !== null && from >= old.from && to <= old.to && old.to - old.from <= length * 1.6 + 2 * step;
  if (serves) return old;
  return { from: Math.floor(from / step) * step, to: Math.ceil(to / step) * step };
}

/** Multiples of `step` in a range, without the noise of adding them up. */
export function ticks({ from, to }: Range, step: number): number[] {
  const first = Math.ceil(from / step - 1e-6);
  const last = Math.floor(to / step + 1e-6);
  return Array.from({ length: Math.max(0, last - first + 1) }, (_, i) => (first + i) * step);
}

/** Metres as text: as many digits as its step needs. */
export function metres(value: number, step: number): string {
  const digits = Math.min(6, Math.max(0, -Math.floor(Math.log10(step) + 1e-9)));
  return (Math.abs(value) < step / 2 ? 0 : value).toFixed(digits);
}
