// SPDX-License-Identifier: Apache-2.0
// The ground and its axes on the graphics card.
import * as THREE from 'three';
import { groundLines, type Ranges } from './ground';
import type { Vec3 } from './pick';

const kAxisColours = [0xd8584c, 0x3f9f55, 0x4a86e0] as const; // x, y, z; their labels': style.css

export class GroundLines {
  readonly object = new THREE.Group();
  private readonly material = new THREE.LineBasicMaterial({ color: 0x8a97a6, transparent: true, opacity: 0.3 });
  private readonly floor = new THREE.LineSegments(new THREE.BufferGeometry(), this.material);
  private readonly axes = new THREE.Group();
  private shown = ''; // which ranges

  constructor() {
    this.object.rotation.x = Math.PI;
    this.object.visible = false;
    this.floor.frustumCulled = false;
    this.object.add(this.floor, this.axes);
  }

  /** Null: none. */
  show(ranges: Ranges | null): void {
    this.object.visible = ranges !== null;
    const now = JSON.stringify(ranges);
    if (ranges === null || now === this.shown) return;
    this.shown = now;
    this.setPoints(this.floor, groundLines(ranges));
    const { x, y, z } = ranges;
    const corner: Vec3 = [x.from, y.to, z.to];
    const ends: Vec3[] = [[x.to, y.to, z.to], [x.from, y.from, z.to], [x.from, y.to, z.from]];
    for (const child of [...this.axes.children]) (child as THREE.LineSegments).geometry.dispose();
    this.axes.clear();
    for (const [i, end] of ends.entries()) {
      const material = new THREE.LineBasicMaterial({ color: kAxisColours[i]!, transparent: true, opacity: 0.48 });
      const axis = new THREE.LineSegments(new THREE.BufferGeometry(), material);
      axis.frustumCulled = false;
      this.setPoints(axis, [corner, end]);
      this.axes.add(axis);
    }
  }

  private setPoints(lines: THREE.LineSegments, points: Vec3[]): void {
    lines.geometry.dispose();
    lines.geometry = new THREE.BufferGeometry();
    lines.geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(points.flat()), 3));
  }
}
