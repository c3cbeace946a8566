// SPDX-License-Identifier: Apache-2.0
// The page around the picture: badge, card, statistics, buttons and keys.
import { kModes, type Mode } from './mesh';
import type { ListedStream } from './protocol';
import type { Presentation } from './state';

const element = <T extends HTMLElement = HTMLElement>(id: string): T => {
  const found = document.getElementById(id);
  if (found === null) throw new Error(`the page has no #${id}`);
  return found as T;
};

/** A cell of the statistics line. `minor` ones give way on a narrow screen. */
export interface Statistic {
  label: string;
  value: string;
  title: string;
  kind?: 'warn' | 'bad' | 'plain';
  minor?: boolean;
}

export interface UiEvents {
  mode(mode: Mode): void;
  stream(name: string): void;
  reset(): void;
  retry(): void;
  orbit(right: number, up: number): void;
  pan(right: number, up: number): void;
  zoom(factor: number): void;
}

const kTurn = 0.06; // radians a key press
const kMove = 0.03; // of the distance
const kZoom = 1.08;

export class Ui {
  readonly canvas = element<HTMLCanvasElement>('view');
  private readonly modes = new Map<Mode, HTMLButtonElement>();
  private shownStreams = '';
  private readonly cells = new Map<string, { box: HTMLElement; value: HTMLElement }>();

  constructor(private readonly events: UiEvents) {
    for (const [i, mode] of kModes.entries()) {
      const button = document.createElement('button');
      button.type = 'button';
      button.textContent = mode[0]!.toUpperCase() + mode.slice(1);
      button.title = `${button.textContent} (${i + 1})`;
      button.onclick = () => events.mode(mode);
      element('modes').append(button);
      this.modes.set(mode, button);
    }
    element('reset').onclick = () => events.reset();
    element('retry').onclick = () => events.retry();
    element('help').onclick = () => this.toggleKeys();
    element('fullscreen').onclick = () => this.toggleFullscreen();
    element('fullscreen').hidden = !document.fullscreenEnabled;
    element<HTMLSelectElement>('streams').onchange = (event) => {
      events.stream((event.target as HTMLSelectElement).value);
      this.canvas.focus();
    };
    window.addEventListener('keydown', (event) => this.onKey(event));
  }

  showMode(mode: Mode): void {
    for (const [name, button] of this.modes) {
      button.setAttribute('aria-pressed', String(name === mode));
    }
  }

  showState(state: Presentation, seen: boolean): void {
    document.body.dataset['state'] = state.state;
    document.body.classList.toggle('dim', state.dim);
    document.body.classList.toggle('seen', seen);
    setText('badge-text', state.label);
    element('card').hidden = state.title === '';
    setText('card-title', state.title);
    setText('card-text', state.text);
    setText('card-hint', state.hint);
    element('card-hint').hidden = state.hint === '';
    element('retry').hidden = state.state !== 'lost';
  }

  /** A line over the picture, which stays visible; null: none. */
  showNotice(text: string | null): void {
    const line = element('notice');
    line.hidden = text === null;
    if (text !== null) setText('notice', `${text}.`);
  }

  showStreams(streams: ListedStream[], chosen: string | null, source: string): void {
    const names = streams.map((s) => s.name);
    if (chosen !== null && !names.includes(chosen)) names.push(chosen);
    names.sort();
    const key = JSON.stringify([names, chosen]);
    document.title = chosen === null ? 'Relievo' : `Relievo · ${chosen}`;
    setText('source', source);
    if (key === this.shownStreams) return;
    this.shownStreams = key;
    element('picker').hidden = names.length === 0;
    const select = element<HTMLSelectElement>('streams');
    select.replaceChildren(
      ...names.map((name) => {
        const option = document.createElement('option');
        option.value = option.textContent = name;
        option.selected = name === chosen;
        return option;
      }),
    );
    select.disabled = names.length < 2;
  }

  showStatistics(statistics: Statistic[]): void {
    const line = element('statistics');
    for (const [label, cell] of this.cells) {
      if (statistics.some((s) => s.label === label)) continue;
      cell.box.remove();
      this.cells.delete(label);
    }
    for (const { label, value, title, kind, minor } of statistics) {
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
      if (cell.value.textContent !== value) cell.value.textContent = value;
      cell.box.title = title;
      cell.box.className = `${kind ?? 'plain'}${minor === true ? ' minor' : ''}`;
    }
  }

  private toggleKeys(): void {
    const keys = element('keys');
    keys.hidden = !keys.hidden;
    element('help').setAttribute('aria-expanded', String(!keys.hidden));
  }

  private toggleFullscreen(): void {
    const done = document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen();
    done.catch(() => undefined); // refused by the browser: nothing changes
  }

  private onKey(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target instanceof HTMLSelectElement) return;
    if (!this.act(event)) return;
    event.preventDefault();
  }

  private act(event: KeyboardEvent): boolean {
    const arrows: Record<string, [number, number]> = {
      ArrowLeft: [-1, 0],
      ArrowRight: [1, 0],
      ArrowUp: [0, 1],
      ArrowDown: [0, -1],
    };
    const arrow = arrows[event.key];
    if (arrow !== undefined) {
      const [x, y] = arrow;
      if (event.shiftKey) this.events.pan(x * kMove, y * kMove);
      else this.events.orbit(x * kTurn, y * kTurn);
      return true;
    }
    const mode = kModes[Number(event.key) - 1];
    if (mode !== undefined) this.events.mode(mode);
    else if (event.key === '+' || event.key === '=') this.events.zoom(kZoom);
    else if (event.key === '-' || event.key === '_') this.events.zoom(1 / kZoom);
    else if (event.key === 'r' || event.key === 'R') this.events.reset();
    else if (event.key === 'f' || event.key === 'F') this.toggleFullscreen();
    else if (event.key === 'h' || event.key === 'H') document.body.classList.toggle('bare');
    else if (event.key === '?') this.toggleKeys();
    else return false;
    return true;
  }
}

function setText(id: string, text: string): void {
  const target = element(id);
  if (target.textContent !== text) target.textContent = text;
}
