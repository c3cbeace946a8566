// SPDX-License-Identifier: Apache-2.0
// How the surface is shown, as a person chose it: kept between visits, and carried by links. Pure, but for the store.
import type { DecodedFrame } from './messages';

export const kModes = ['textured', 'shaded', 'wireframe', 'points', 'normals', 'depth', 'confidence'] as const;
export type Mode = (typeof kModes)[number];

/** How a person moves: around a pivot, freely, or not at all: as the rig's camera sees it. */
export const kWays = ['orbit', 'fly', 'camera'] as const;
export type Way = (typeof kWays)[number];

export const kBackgrounds = ['theme', 'black', 'grey', 'white'] as const;
export type Background = (typeof kBackgrounds)[number];

/** What stands beside the surface. */
export const kSplits = ['none', 'picture', 'stripes', 'both'] as const;
export type Split = (typeof kSplits)[number];

export const kThemes = ['auto', 'dark', 'light'] as const;
export type Theme = (typeof kThemes)[number];

/** What a surface needs beside its vertices and triangles. */
export interface Wants {
  normals: boolean;
  edges: boolean;
  quality: boolean;
  rims: boolean;
}

/** Of a mode; `textured`: the surface has a picture. */
export function wantsOf(mode: Mode, textured: boolean): Wants {
  const unlit = (mode === 'textured' && textured) || mode === 'depth' || mode === 'wireframe' || mode === 'points';
  const rims = mode === 'textured' || mode === 'shaded';
  return { normals: !unlit, edges: mode === 'wireframe', quality: mode === 'confidence', rims };
}

export const hasPicture = ({ texture, coordinates }: Pick<DecodedFrame, 'texture' | 'coordinates'>): boolean =>
  texture !== null && coordinates !== null;

export interface Display {
  mode: Mode;
  way: Way;
  background: Background;
  theme: Theme;
  grid: boolean;
  smooth: boolean; // rims, where no numbers are read
  split: Split;
  fov: number; // degrees, upright, of orbit and fly; 0: the rig camera's
}

export const kDefaultDisplay: Readonly<Display> = {
  mode: 'textured',
  way: 'orbit',
  background: 'theme',
  theme: 'auto',
  grid: true,
  smooth: true,
  split: 'none',
  fov: 0,
};

export const kFov = { least: 15, most: 100 };

/** What of `text` makes sense, over `fallback`; any input. */
export function parseDisplay(text: string, fallback: Readonly<Display> = kDefaultDisplay): Display {
  const given = new URLSearchParams(text);
  const one = <T extends string>(key: string, of: readonly T[], otherwise: T): T =>
    of.find((name) => name === given.get(key)) ?? otherwise;
  const flag = (key: string, otherwise: boolean): boolean =>
    given.get(key) === '1' ? true : given.get(key) === '0' ? false : otherwise;
  const fov = given.has('fov') ? Number(given.get('fov')) : NaN;
  return {
    mode: one('mode', kModes, fallback.mode),
    way: one('way', kWays, fallback.way),
    background: one('background', kBackgrounds, fallback.background),
    theme: one('theme', kThemes, fallback.theme),
    grid: flag('grid', fallback.grid),
    smooth: flag('smooth', fallback.smooth),
    split: given.get('split') === '1' ? 'picture' : one('split', kSplits, fallback.split), // 1: of older links
    fov: fov === 0 || (fov >= kFov.least && fov <= kFov.most) ? fov : fallback.fov,
  };
}

/** Only what differs from `base`. */
export function writeDisplay(display: Display, base: Readonly<Display> | null = kDefaultDisplay): URLSearchParams {
  const out = new URLSearchParams();
  for (const key of Object.keys(kDefaultDisplay) as (keyof Display)[]) {
    if (base !== null && display[key] === base[key]) continue;
    const value = display[key];
    out.set(key, typeof value === 'boolean' ? (value ? '1' : '0') : String(value));
  }
  return out;
}

const kStored = 'relievo.display';

/** The browser may forbid a store. */
export function loadDisplay(): Display {
  try {
    return parseDisplay(localStorage.getItem(kStored) ?? '');
  } catch {
    return { ...kDefaultDisplay };
  }
}

export function storeDisplay(display: Display): void {
  try {
    localStorage.setItem(kStored, writeDisplay(display).toString());
  } catch {
    // the choice lasts as long as the page
  }
}
