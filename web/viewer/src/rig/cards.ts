// SPDX-License-Identifier: Apache-2.0
// The figures of one look, each card about one thing.
import { make, setText } from '../dom';

import { drawHistogram } from './histogram';

import type { Look, Margin } from './look';
import { text } from './strings';

const percent = (share: number): string => `${(100 * share).toFixed(share < 0.1 ? 1 : 0)} %`;

/** Without a minus before zero. */
const decimals = (value: number, n: number): string => value.toFixed(n).replace(/^-(0\.0*)$/, '$1');

/** A titled card in the column. */
export function card(id: string, title: string, ...content: HTMLElement[]): HTMLElement {
  const heading = make('h2', { id: `${id}-title` }, title);
  const made = make('section', { id, className: 'card' }, heading, ...content);
  made.setAttribute('aria-labelledby', heading.id);
  return made;
}

/** Names and values; a value is written by its name's key. */
class Figures<Key extends string> {
  readonly list = make('dl', { className: 'figures' });
  private readonly rows = new Map<
    Key,
    {
      name: HTMLElement;
      value: HTMLElement;
    }
  >();

  constructor(keys: readonly Key[]) {
    for (const key of keys) {
      const row = { name: make('dt'), value: make('dd') };
      row.value.dataset['figure'] = key;
      this.rows.set(key, row);
      this.list.append(row.name, row.value);
    }
  }
  set(key: Key, name: string, value: string, bad = false): void {
    const row = this.rows.get(key)!;
    setText(row.name, name);
    setText(row.value, value);
    row.value.classList.toggle('bad', bad);
  }
}

export class AdviceCard {
  private readonly list = make('ul');
  readonly root = card('advice', text.advice.title, this.list);
  private shown = '';

  constructor() {
    this.list.setAttribute('aria-live', 'polite');
  }
  show(look: Look): void {
    const lines = look.advice.length > 0 ? look.advice : [text.advice.none];
    // Numbers in it change from frame to frame: who listens is told of new advice alone.
    const kind = lines.join('\n').replace(/[\d.]+/g, '#');
    this.root.classList.toggle('good', look.advice.length === 0);
    if (kind === this.shown) {
      lines.forEach((line, i) => setText(this.list.children[i] as HTMLElement, line));
      return;
    }
    this.shown = kind;
    this.list.replaceChildren(...lines.map((line) => make('li', {}, line)));
  }
}

export class ExposureCard {
  private readonly canvas = make('canvas', { className: 'plot' });
  private readonly figures = new Figures(['clipped', 'dark', 'bright']);
  readonly root = card('exposure', text.exposure.title, this.canvas, this.figures.list);

  constructor() {
    this.canvas.setAttribute('role', 'img');
  }
  show({ exposure }: Look): void {
    const { clipped, dark, bright } = exposure;
    drawHistogram(this.canvas, exposure.histogram);
    this.canvas.setAttribute('aria-label', text.exposure.histogram(percent(clipped), percent(dark)));
    this.figures.set('clipped', text.exposure.clipped(exposure.clipped_level), percent(clipped), clipped > 0.01);
    this.figures.set('dark', text.exposure.dark(exposure.dark_level), percent(dark));
    this.figures.set('bright', text.exposure.bright, String(bright));
  }
}

export class MarginsCard {
  private readonly about = make('p', { className: 'quiet' });
  private readonly rows = make('tbody');
  private readonly table = make(
    'table',
    {},
    make('thead', {}, make('tr', {}, ...text.margins.columns.map((name) => (name === '' ? make('td') : make('th', { scope: 'col' }, name))))),
    this.rows,
  );
  readonly root = card('margins', text.margins.title, this.table, this.about);

  show(look: Look): void {
    setText(this.about, text.margins.about(look.margin_needed, look.noise));
    this.rows.replaceChildren(...look.margins.map((margin) => this.row(margin, look.margin_needed)));
  }

  private row(margin: Margin, needed: number): HTMLElement {
    const { colour, low, wrong } = margin;
    const name = make(
      'th',
      { scope: 'row' },
      make('i', { className: `colour colour-${colour}` }),
      text.colours[colour] ?? colour,
    );
    const value = make('td', {}, low === null ? text.margins.none : low.toFixed(0));
    value.dataset['margin'] = colour;
    const bar = make('meter', { min: 0, max: 255, low: needed, value: Math.max(0, low ?? 0) });
    bar.setAttribute('aria-hidden', 'true'); // says what the number beside it does
    const share = make('td', {}, wrong === null ? text.margins.none : percent(wrong));
    value.classList.toggle('bad', low !== null && low < needed);
    return make('tr', {}, name, value, make('td', {}, bar), share);
  }
}

export class StripesCard {
  private readonly figures = new Figures(['coverage', 'lit', 'seen', 'points', 'order']);
  readonly root = card('stripes', text.stripes.title, this.figures.list);

  show({ coverage, boundaries: b }: Look): void {
    const say = text.stripes;
    this.figures.set('coverage', say.coverage, percent(coverage.share), coverage.share < 0.85);
    this.figures.set('lit', say.lit, percent(coverage.lit));
    this.figures.set('seen', say.seen, String(b.seen));
    this.figures.set('points', say.points, String(b.points));
    this.figures.set('order', say.order, `${b.order_errors} / ${b.neighbours}`, b.order_errors > 0.05 * b.neighbours);
  }
}

export class StepCard {
  private readonly figures = new Figures(['mixed', 'phase', 'drift']);
  readonly root = card('step', text.step.title, this.figures.list);

  show({ step }: Look): void {
    const say = text.step;
    this.figures.set('mixed', say.mixed, String(step.mixed), step.mixed > 0);
    this.figures.set(
      'phase',
      say.phase,
      step.phase === null ? say.unknown : decimals(step.phase > 1.5 ? step.phase - 2 : step.phase, 2),
    );
    this.figures.set('drift', say.drift, step.drift_fields_s === null ? say.unknown : decimals(step.drift_fields_s, 3));
  }
}
