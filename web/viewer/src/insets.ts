// SPDX-License-Identifier: Apache-2.0
// What lies over the sides of the picture, and where the middle of the rest is. Pure; pixels of the page.
import type { Size } from './rigCamera';

/** How far in from each side something lies over the picture. */
export interface Insets {
  top: number;
  right: number;
  bottom: number;
  left: number;
}

/** Sides of a rectangle of the page. */
export type Box = Readonly<Insets>;

/** Pixels, between what is looked at and what lies over the picture's sides. */
export const kClear = 8;

export const kNoInsets: Insets = { top: 0, right: 0, bottom: 0, left: 0 };

const kLeast = 1 / 3; // of the picture, else its parts count as not there
const kLeastBesidePanel = 0.45; // of its width, else the panel does

/** With a panel at a side of the picture; `insets` itself where the panel leaves too little beside it, as on a phone. */
export function withPanel(insets: Insets, picture: Box, panel: Box): Insets {
  const isRight = panel.left + panel.right > picture.left + picture.right;
  const right = isRight ? Math.max(insets.right, picture.right - panel.left) : insets.right;
  const left = isRight ? insets.left : Math.max(insets.left, panel.right - picture.left);
  const width = picture.right - picture.left;
  return width - left - right < kLeastBesidePanel * width ? insets : { ...insets, left, right };
}

/** What nothing lies over, by its middle. */
export function freeOf(size: Size, { top, right, bottom, left }: Insets): { x: number; y: number; width: number; height: number } {
  const along = (before: number, behind: number, all: number): [number, number] =>
    all - before - behind < all * kLeast ? [all / 2, all] : [(before + all - behind) / 2, all - before - behind];
  const [x, width] = along(left, right, size.width);
  const [y, height] = along(top, bottom, size.height);
  return { x, y, width, height };
}

/** Of a view whose axis goes through the middle of what is free, as three's setViewOffset() takes it. */
export function viewOffset(size: Size, insets: Insets): [fullWidth: number, fullHeight: number, x: number, y: number, width: number, height: number] {
  const { x, y } = freeOf(size, insets);
  const { width, height } = size;
  return [width, height, width / 2 - x, height / 2 - y, width, height];
}
