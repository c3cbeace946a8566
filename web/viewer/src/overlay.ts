// SPDX-License-Identifier: Apache-2.0
// Text and marks over the picture, at places of the scene: drawn after it, in the page's own resolution.
import { windowOf } from './dom';
import type { Label } from './ground';
import type { Vec3 } from './pick';

export interface Mark {
  points: Vec3[]; // of the scene; joined by lines
  dots: Vec3[]; // where a person has clicked
  ring?: Vec3; // what a click would be on
  text: string; // at the middle of the points
}

type Project = (point: Vec3) => { x: number; y: number } | null;

/** By its middle. */
export interface Box {
  x: number;
  y: number;
  width: number;
  height: number;
}

export const overlap = (a: Box, b: Box): boolean =>
  Math.abs(a.x - b.x) < (a.width + b.width) / 2 && Math.abs(a.y - b.y) < (a.height + b.height) / 2;

type Place = Readonly<{ x: number; y: number }>;

/** Where a mark's text may stand, the best first: over or below its middle, or beside that on its way. */
export function placesOf(points: readonly Place[]): Place[] {
  const mean = (of: 'x' | 'y'): number => points.reduce((sum, p) => sum + p[of], 0) / points.length;
  const [x, y] = [mean('x'), mean('y')];
  const [dx, dy] = [points.at(-1)!.x - points[0]!.x, points.at(-1)!.y - points[0]!.y];
  return [0, -0.25, 0.25].flatMap((share) => [-14, 14].map((off) => ({ x: x + share * dx, y: y + share * dy + off })));
}

const kApart = 3; // pixels between two words

export class Overlay {
  private readonly context: CanvasRenderingContext2D;
  /** Asked for at each drawing: what they are on may have moved. */
  marks: () => readonly Mark[] = () => [];
  /** What lies over the picture: a number half under it would be read wrong. */
  covers: readonly Box[] = [];

  constructor(private readonly canvas: HTMLCanvasElement) {
    this.context = canvas.getContext('2d')!;
  }

  draw(project: Project, labels: readonly Label[]): void {
    const ratio = Math.min(windowOf(this.canvas).devicePixelRatio, 2);
    const { clientWidth, clientHeight } = this.canvas;
    const [width, height] = [Math.round(clientWidth * ratio), Math.round(clientHeight * ratio)];
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
    }
    const c = this.context;
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.clearRect(0, 0, clientWidth, clientHeight);
    c.textBaseline = 'middle';
    c.textAlign = 'center';
    const style = getComputedStyle(this.canvas);
    const line = parseFloat(style.fontSize);
    c.font = `${line}px system-ui, sans-serif`;
    const halo = style.getPropertyValue('--halo');
    const accent = style.getPropertyValue('--mark');
    const taken: Box[] = [...this.covers];
    for (const { at, text, colour } of labels) {
      const place = project(at);
      if (place === null) continue;
      const box = { x: place.x, y: place.y + 0.8 * line, width: c.measureText(text).width + kApart, height: line };
      if (taken.some((other) => overlap(box, other))) continue; // neither could be read
      taken.push(box);
      this.text(text, box.x, box.y, style.getPropertyValue(colour), halo);
    }
    for (const mark of this.marks()) this.mark(mark, project, taken, [accent, halo, line]);
  }

  private mark({ points, dots, ring, text }: Mark, project: Project, taken: Box[], [accent, halo, line]: readonly [string, string, number]): void {
    const places = points.map(project);
    const seen = places.filter((p) => p !== null);
    if (seen.length === 0) return;
    const c = this.context;
    c.lineJoin = 'round';
    if (seen.length === places.length && seen.length > 1) {
      for (const [colour, width] of [[halo, 4], [accent, 1.75]] as const) {
        c.strokeStyle = colour;
        c.lineWidth = width;
        c.beginPath();
        for (const [i, p] of seen.entries()) i === 0 ? c.moveTo(p.x, p.y) : c.lineTo(p.x, p.y);
        c.stroke();
      }
    }
    for (const dot of dots.map(project)) {
      if (dot === null) continue;
      c.beginPath();
      c.arc(dot.x, dot.y, 4, 0, 2 * Math.PI);
      c.fillStyle = accent;
      c.strokeStyle = halo;
      c.lineWidth = 1.5;
      c.fill();
      c.stroke();
    }
    const around = ring === undefined ? null : project(ring);
    if (around !== null) {
      for (const [colour, width] of [[halo, 4], [accent, 1.75]] as const) {
        c.strokeStyle = colour;
        c.lineWidth = width;
        c.beginPath();
        c.arc(around.x, around.y, 8, 0, 2 * Math.PI);
        c.stroke();
      }
    }
    if (text === '') return;
    const width = this.context.measureText(text).width + kApart;
    const free = placesOf(seen).find(({ x, y }) => !taken.some((other) => overlap({ x, y, width, height: line }, other)));
    const { x, y } = free ?? placesOf(seen)[0]!;
    taken.push({ x, y, width, height: line });
    this.text(text, x, y, accent, halo);
  }

  private text(text: string, x: number, y: number, colour: string, halo: string): void {
    const c = this.context;
    c.lineWidth = 3;
    c.lineJoin = 'round';
    c.strokeStyle = halo;
    c.fillStyle = colour;
    c.strokeText(text, x, y);
    c.fillText(text, x, y);
  }
}
