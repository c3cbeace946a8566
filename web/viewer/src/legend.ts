// SPDX-License-Identifier: Apache-2.0
// What the surface's colours mean, beside it.
import { element, make } from './dom';
import type { Mode } from './display';
import { depthColour, metres, niceStep, ticks, toSrgb, type Range } from './palette';
import { confidenceColour, kBestSigma, kWorstSigma } from './quality';
import { text } from './strings';

const kBar = { width: 14, height: 168 };
const kDisc = 72;
const kMostOnPhones = 6; // marks that have room beside each other
const kSigmaTicks: readonly (readonly [number, string])[] = [
  [20e-6, '20 µm'],
  [50e-6, '50 µm'],
  [100e-6, '0.1 mm'],
  [200e-6, '0.2 mm'],
  [500e-6, '0.5 mm'],
  [1e-3, '1 mm'],
  [2e-3, '2 mm'],
];

export class Legend {
  private readonly box = element('legend');
  private shown = '';

  /** `range` of the depth mode. */
  show(mode: Mode, range: Range | null): void {
    const key = mode === 'depth' ? `depth ${range?.from} ${range?.to}` : mode;
    if (key === this.shown) return;
    this.shown = key;
    const content = mode === 'depth' && range ? depthLegend(range) : mode === 'confidence' ? sigmaLegend() : null;
    const drawn = content ?? (mode === 'normals' ? normalLegend() : null);
    this.box.hidden = drawn === null;
    this.box.replaceChildren(...(drawn ?? []));
  }
}

function depthLegend(range: Range): Node[] {
  const step = niceStep(range.to - range.from, 6);
  const marks = ticks(range, step).map(
    (v) => [(v - range.from) / (range.to - range.from), metres(v, step)] as const,
  );
  return [make('h2', {}, text.legend.depth), bar((share) => depthColour(share), marks)];
}

function sigmaLegend(): Node[] {
  const octaves = Math.log2(kWorstSigma / kBestSigma);
  const marks = kSigmaTicks.map(([sigma, name]) => [Math.log2(sigma / kBestSigma) / octaves, name] as const);
  const colour = (share: number): readonly number[] =>
    confidenceColour(kBestSigma * 2 ** (share * octaves)).map(toSrgb);
  const swatch = make('i', {});
  swatch.style.background = `rgb(${confidenceColour(0).map(toSrgb).join(' ')})`;
  return [
    make('h2', {}, text.legend.confidence),
    bar(colour, marks),
    make('p', {}, swatch, text.legend.unknown),
    make('p', { className: 'quiet' }, text.legend.interpolated),
  ];
}

function normalLegend(): Node[] {
  const canvas = make('canvas', { width: kDisc, height: kDisc, className: 'disc' });
  const context = canvas.getContext('2d')!;
  const pixels = context.createImageData(kDisc, kDisc);
  for (let row = 0; row < kDisc; ++row) {
    for (let column = 0; column < kDisc; ++column) {
      const x = ((column + 0.5) / kDisc) * 2 - 1;
      const y = 1 - ((row + 0.5) / kDisc) * 2;
      const z2 = 1 - x * x - y * y;
      if (z2 < 0) continue;
      const rgb = [x, y, Math.sqrt(z2)].map((n) => (n * 0.5 + 0.5) * 255);
      pixels.data.set([...rgb, 255], (row * kDisc + column) * 4);
    }
  }
  context.putImageData(pixels, 0, 0);
  return [make('h2', {}, text.legend.normals), canvas, make('p', { className: 'quiet' }, text.legend.normalsHow)];
}

/** A bar with 0 on top, on phones at the left; marks by their share of its length. */
function bar(colour: (share: number) => readonly number[], marks: readonly (readonly [number, string])[]): HTMLElement {
  const canvas = make('canvas', { width: 1, height: kBar.height });
  const context = canvas.getContext('2d')!;
  for (let y = 0; y < kBar.height; ++y) {
    context.fillStyle = `rgb(${colour(y / (kBar.height - 1)).join(' ')})`;
    context.fillRect(0, y, 1, 1);
  }
  const scale = make('ol', { className: marks.length > kMostOnPhones ? 'crowded' : '' });
  for (const [share, name] of marks) {
    const mark = make('li', {}, name);
    mark.style.setProperty('--at', `${share * 100}%`);
    scale.append(mark);
  }
  return make('div', { className: 'bar' }, canvas, scale);
}
