// SPDX-License-Identifier: Apache-2.0
// Small plots in panels, in the page's colours and the screen's resolution.
import { metres, niceStep, ticks, type Range } from './palette';

const kMargin = { left: 3.8, right: 0.8, top: 0.8, bottom: 2 }; // of the letters' size

export interface Line {
  points: readonly (readonly [number, number])[]; // NaN ends a stretch
  colour: string; // a property of style.css
}

export interface Axes {
  x: Range;
  y: Range;
  unit: string; // of both, at the corner
}

/** What lies above `y` is cut off there. */
export function plot(canvas: HTMLCanvasElement, { x, y, unit }: Axes, lines: readonly Line[]): void {
  const ratio = Math.min(window.devicePixelRatio, 2);
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const c = canvas.getContext('2d')!;
  c.scale(ratio, ratio);
  const style = getComputedStyle(canvas);
  const em = parseFloat(style.fontSize);
  const [left, right, top, bottom] = [kMargin.left * em, kMargin.right * em, kMargin.top * em, kMargin.bottom * em];
  const inner = { width: width - left - right, height: height - top - bottom };
  const atX = (v: number): number => left + ((v - x.from) / (x.to - x.from)) * inner.width;
  const atY = (v: number): number => top + (1 - (v - y.from) / (y.to - y.from)) * inner.height;
  c.font = `${em}px system-ui, sans-serif`;
  c.fillStyle = style.getPropertyValue('--quiet');
  c.strokeStyle = style.getPropertyValue('--line');
  c.textBaseline = 'middle';
  c.textAlign = 'right';
  const stepY = niceStep(y.to - y.from, 4);
  for (const v of ticks(y, stepY)) {
    rule(c, [left, atY(v)], [width - right, atY(v)]);
    c.fillText(metres(v, stepY), left - em / 2, atY(v));
  }
  c.textAlign = 'center';
  const stepX = niceStep(x.to - x.from, 5);
  for (const v of ticks(x, stepX)) {
    rule(c, [atX(v), top], [atX(v), height - bottom]);
    c.fillText(metres(v, stepX), atX(v), height - bottom + em);
  }
  c.textAlign = 'left';
  c.fillText(unit, 2, height - bottom + em);
  c.save();
  c.beginPath();
  c.rect(left, top, inner.width, inner.height);
  c.clip();
  c.lineWidth = 1.5;
  c.lineJoin = 'round';
  for (const line of lines) {
    c.strokeStyle = style.getPropertyValue(line.colour);
    c.beginPath();
    let down = false;
    for (const [px, py] of line.points) {
      if (Number.isNaN(py)) down = false;
      else if (down) c.lineTo(atX(px), atY(py));
      else {
        c.moveTo(atX(px), atY(py));
        down = true;
      }
    }
    c.stroke();
  }
  c.restore();
  // What is cut off at the top is told by its number.
  let beyond: readonly [number, number] | null = null;
  for (const { points } of lines) for (const point of points) if (point[1] > (beyond?.[1] ?? y.to)) beyond = point;
  if (beyond === null) return;
  const said = `↑ ${metres(beyond[1], stepY)}`;
  const half = c.measureText(said).width / 2;
  c.fillStyle = style.getPropertyValue('--text');
  c.textAlign = 'center';
  c.fillText(said, Math.min(Math.max(atX(beyond[0]), left + half), width - right - half), top + em / 2);
}

function rule(c: CanvasRenderingContext2D, from: [number, number], to: [number, number]): void {
  c.lineWidth = 1;
  c.beginPath();
  c.moveTo(...from);
  c.lineTo(...to);
  c.stroke();
}
