// SPDX-License-Identifier: Apache-2.0
// From where a surface is first seen: the rig's own camera, moved aside and up far enough that relief reads. Pure.
import type { Vec3 } from './pick';
import type { Box, Extent } from './surface';

const kAzimuth = (16 * Math.PI) / 180;
const kElevation = (13 * Math.PI) / 180;
const kMargin = 1.1;
const kAround = 1.25; // of a subject, so that something of what is behind it is seen

export interface FirstView {
  position: Vec3; // in three's frame: y up, z towards the viewer
  target: Vec3;
  distance: number;
}

/** Whether the view is of the subject or of all is chosen once: what comes and goes in the stream must not make it jump. */
export class Framing {
  private isOfSubject = false;
  private subject: Box | null = null; // the last there was

  /** By the surface as it is, for the calls of frame() from here on. */
  choose({ subject }: Extent): void {
    this.isOfSubject = subject !== undefined;
  }

  /** Of the surface as it is now, what the view is of. */
  frame({ subject, ...whole }: Extent): Extent {
    this.subject = subject ?? this.subject;
    return this.isOfSubject && this.subject !== null ? { ...whole, subject: this.subject } : whole;
  }
}

/** `right` and `up`: tangents from the middle of what is free on the page to its sides. */
export function firstView(extent: Extent, right: number, up: number): FirstView {
  const { min, max } = extent.subject ?? extent;
  const margin = kMargin * (extent.subject === undefined ? 1 : kAround);
  const half = [0, 1, 2].map((i) => (max[i]! - min[i]!) / 2) as Vec3;
  const middle = [0, 1, 2].map((i) => (max[i]! + min[i]!) / 2) as Vec3;
  const width = half[0] * Math.cos(kAzimuth) + half[2] * Math.sin(kAzimuth);
  const height = half[1] * Math.cos(kElevation) + half[2] * Math.sin(kElevation);
  const distance = margin * Math.max(height / up, width / right) + half[2] * 0.5;
  const target: Vec3 = [middle[0], -middle[1], -middle[2]];
  const away: Vec3 = [
    Math.cos(kElevation) * Math.sin(kAzimuth),
    Math.sin(kElevation),
    Math.cos(kElevation) * Math.cos(kAzimuth),
  ];
  const position = target.map((t, i) => t + distance * away[i]!) as Vec3;
  return { position, target, distance };
}
