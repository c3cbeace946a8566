// SPDX-License-Identifier: Apache-2.0
// The rig's camera as a camera of the scene: what it sees, at its place in the page. Pure.
// Pixels of the picture: the centre of the first is (0, 0). Pixels of the page: its upper left corner is (0, 0).
import { freeOf, type Insets } from './insets';
import { undistort, type Lens } from './lens';
import type { Pinhole } from './protocol';

export interface Size {
  width: number;
  height: number;
}

export interface Rectangle extends Size {
  x: number;
  y: number;
}

/** The whole picture, as large as it fits where nothing lies over the page, and in the middle of that. */
export function pictureRectangle(camera: Size, page: Size, insets: Insets): Rectangle {
  const free = freeOf(page, insets);
  const scale = Math.min(free.width / camera.width, free.height / camera.height);
  const [width, height] = [camera.width * scale, camera.height * scale];
  return { x: free.x - width / 2, y: free.y - height / 2, width, height };
}

export interface Frustum {
  left: number; // tangents of the view's sides: x/z and, upwards, y/z
  right: number;
  top: number;
  bottom: number;
}

/** What the page shows where the rig's picture lies in pictureRectangle(). */
export function rigFrustum(camera: Pinhole, page: Size, insets: Insets): Frustum {
  const { x, y, width } = pictureRectangle(camera, page, insets);
  const scale = width / camera.width;
  const column = (at: number): number => ((at - x) / scale - 0.5 - camera.cx) / camera.fx;
  const row = (at: number): number => ((at - y) / scale - 0.5 - camera.cy) / camera.fy;
  return { left: column(0), right: column(page.width), top: -row(0), bottom: -row(page.height) };
}

export function lensOf(camera: Pinhole): Lens {
  const [k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0] = camera.distortion ?? [];
  const { width, height, fx, fy, cx, cy } = camera;
  return { width, height, fx, fy, cx, cy, skew: 0, distortion: [k1, k2, p1, p2, k3] };
}

/** The direction in the camera's frame (x right, y down, z 1) of a place on the page; null where the lens shows nothing. */
export function rigRay(camera: Pinhole, page: Size, insets: Insets, at: { x: number; y: number }): [number, number, number] | null {
  const picture = pictureRectangle(camera, page, insets);
  const scale = picture.width / camera.width;
  const ray = undistort(lensOf(camera), (at.x - picture.x) / scale - 0.5, (at.y - picture.y) / scale - 0.5);
  return ray === null ? null : [ray[0], ray[1], 1];
}
