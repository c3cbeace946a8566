// SPDX-License-Identifier: Apache-2.0
// The page around the picture: badge, card, list of streams, statistics line.
import { element, make, setText } from './dom';
import { kClear, withPanel, type Insets } from './insets';
import { rigPage, type ListedStream } from './protocol';
import type { Box } from './overlay';
import type { Presentation } from './state';
import { text } from './strings';

/** A cell of the statistics line. `minor` ones give way on a narrow screen. */
export interface Statistic {
  label: string;
  value: string;
  more?: string; // behind it, where there is room
  title: string;
  kind?: 'warn' | 'bad' | 'plain';
  minor?: boolean;
}

export interface UiEvents {
  stream(name: string): void;
  retry(): void;
  dismiss(): void;
  /** Of what is there for good, and with the panel that is open; the same where none is. */
  insets(parts: Insets, withPanel: Insets): void;
  /** What lies over the picture, each by itself. */
  covers(boxes: readonly Box[]): void;
}

const openPanel = (): Element | null => document.querySelector('#panels aside:not([hidden])');

export class Ui {
  readonly canvas = element<HTMLCanvasElement>('view');
  private shownStreams = '';
  private readonly around: ResizeObserver; // of what lies over the picture
  private readonly cells = new Map<string, { box: HTMLElement; value: HTMLElement }>();

  constructor(events: UiEvents) {
    element('retry').onclick = () => events.retry();
    element('dismiss').onclick = () => events.dismiss();
    // The card may move before its button is let go.
    element('card').onpointerdown = ({ target, pointerId }) => (target as Element).closest('button')?.setPointerCapture(pointerId);
    element<HTMLSelectElement>('streams').onchange = (event) => {
      events.stream((event.target as HTMLSelectElement).value);
      this.canvas.focus();
    };
    // Their parts stand above and beside each other where the page is small.
    const [header, rail, footer] = this.parts;
    const say = (name: string, size: number): void => document.body.style.setProperty(name, `${size}px`);
    new ResizeObserver(() => say('--header', header.offsetHeight)).observe(header);
    new ResizeObserver(() => say('--footer', footer.offsetHeight)).observe(footer);
    new ResizeObserver(() => say('--rail', rail.offsetWidth)).observe(rail);
    this.around = new ResizeObserver(() => {
      const panel = openPanel()?.getBoundingClientRect();
      if (panel !== undefined) say('--panel-height', panel.height);
      const { insets } = this;
      const isSeen = panel !== undefined && panel.width > 0;
      events.insets(insets, isSeen ? withPanel(insets, this.canvas.getBoundingClientRect(), panel) : insets);
      events.covers(this.covers);
    });
    for (const part of [...this.parts, ...this.coverable, this.canvas]) this.around.observe(part);
  }

  /** A panel, which lies over the picture while it is open. */
  watch(panel: HTMLElement): void {
    this.around.observe(panel);
  }

  private get parts(): [header: HTMLElement, rail: HTMLElement, footer: HTMLElement] {
    return [document.querySelector('header')!, element('rail'), document.querySelector('footer')!];
  }

  private get coverable(): Element[] {
    const [header, rail, footer] = this.parts;
    return [...header.children, rail, ...footer.children, element('legend'), element('notice')];
  }

  /** What lies over the picture's sides for good. */
  private get insets(): Insets {
    const picture = this.canvas.getBoundingClientRect();
    const [header, rail, footer] = this.parts.map((part) => part.getBoundingClientRect()) as [DOMRect, DOMRect, DOMRect];
    return {
      top: header.height === 0 ? 0 : Math.max(0, header.bottom + kClear - picture.top), // 0 where it is hidden
      right: rail.width === 0 ? 0 : Math.max(0, picture.right - rail.left + kClear),
      bottom: footer.height === 0 ? 0 : Math.max(0, picture.bottom - footer.top + kClear),
      left: 0,
    };
  }

  private get covers(): Box[] {
    const { left, top } = this.canvas.getBoundingClientRect();
    const panel = openPanel();
    const parts = [...this.coverable, ...(panel === null ? [] : [panel])].filter((part) => part.checkVisibility({ visibilityProperty: true }));
    return parts
      .map((part) => part.getBoundingClientRect())
      .filter(({ width }) => width > 0)
      .map(({ x, y, width, height }) => ({ x: x + width / 2 - left, y: y + height / 2 - top, width, height }));
  }

  showState(state: Presentation, seen: boolean, dismissible: boolean): void {
    document.body.dataset['state'] = state.state;
    document.body.classList.toggle('dim', state.dim);
    document.body.classList.toggle('seen', seen);
    setText(element('badge-text'), state.label);
    element('card').hidden = state.title === '';
    setText(element('card-title'), state.title);
    setText(element('card-text'), state.text);
    setText(element('card-hint'), state.hint);
    element('card-hint').hidden = state.hint === '';
    element('retry').hidden = state.state !== 'lost' || dismissible;
    element('dismiss').hidden = !dismissible;
    element('spinner').hidden = dismissible; // what is said is said: nothing is waited for
  }

  /** A line over the picture, which stays visible; empty: none. `rig`: the stream whose page mends it. */
  showNotice(what: string, rig: string | null): void {
    element('notice').hidden = what === '';
    if (what === '') return;
    setText(element('notice-text'), what);
    const link = element<HTMLAnchorElement>('notice-rig');
    link.hidden = rig === null;
    if (rig !== null) link.href = rigPage(rig);
  }

  showStreams(streams: readonly ListedStream[], chosen: string | null, source: string, note: string): void {
    const names = streams.map((s) => s.name);
    if (chosen !== null && !names.includes(chosen)) names.push(chosen);
    names.sort();
    const key = JSON.stringify([names, chosen]);
    const shown = chosen ?? source;
    document.title = shown === '' ? text.product : `${text.product} · ${shown}`;
    const said = element('source');
    setText(said, note === '' ? source : text.file.note(source, note));
    said.title = said.textContent; // where there is no room for all of it
    said.classList.toggle('matters', note !== '' || (chosen === null && source !== '')); // no list says it
    if (key === this.shownStreams) return;
    this.shownStreams = key;
    element('picker').hidden = names.length === 0;
    const select = element<HTMLSelectElement>('streams');
    select.title = chosen ?? '';
    select.replaceChildren(
      ...names.map((name) => {
        const option = document.createElement('option');
        option.value = option.textContent = name;
        option.selected = name === chosen;
        return option;
      }),
    );
    if (chosen === null) {
      // A file is shown: any stream may be chosen.
      select.prepend(make('option', { value: '', disabled: true, hidden: true }, text.chooseStream));
      select.value = '';
    }
    select.disabled = names.length < 2 && chosen !== null;
  }

  showStatistics(statistics: Statistic[]): void {
    const line = element('statistics');
    for (const [label, cell] of this.cells) {
      if (statistics.some((s) => s.label === label)) continue;
      cell.box.remove();
      this.cells.delete(label);
    }
    for (const { label, value, more = '', title, kind, minor } of statistics) {
      let cell = this.cells.get(label);
      if (cell === undefined) {
        const box = document.createElement('div');
        const term = document.createElement('dt');
        const text = document.createElement('dd');
        term.textContent = label;
        box.append(term, text);
        line.append(box);
        cell = { box, value: text };
        this.cells.set(label, cell);
      }
      if (cell.value.textContent !== value + more) cell.value.replaceChildren(value, make('span', { className: 'more' }, more));
      cell.box.title = title;
      cell.box.className = `${kind ?? 'plain'}${minor === true ? ' minor' : ''}`;
    }
  }
}
