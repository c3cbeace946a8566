// SPDX-License-Identifier: Apache-2.0
// The rail of buttons at the page's edge, and the panels that some of them open, one at a time.
import { button as textButton, element, make } from './dom';
import { text } from './strings';

export type RailName = keyof typeof text.rail;

const kIcons: Record<RailName, string> = {
  streams: 'M4 5h7v6H4zM13 5h7v6h-7zM4 13h7v6H4zM13 13h7v6h-7z',
  record: 'M12 5a7 7 0 1 0 .01 0M12 9a3 3 0 1 0 .01 0',
  open: 'M3 7h6l2 2h10v10H3zM12 17v-5M9.5 14 12 11.5 14.5 14',
  display: 'M4 7h9M17 7h3M4 17h3M11 17h9M15 4.5v5M9 14.5v5',
  measure: 'M3.5 15.5 15.5 3.5l5 5-12 12zM7 12l2.5 2.5M10 9l1.5 1.5M13 6l2.5 2.5',
  statistics: 'M4 20V4M4 20h16M8 16l3.5-5 3 3L20 7',
  take: 'M12 4v11M7.5 10.5 12 15l4.5-4.5M4 19.5h16',
  reset: 'M5 12a7 7 0 1 0 2.2-5.1M4.5 4v4h4',
  fullscreen: 'M4 9V4h5M15 4h5v5M20 15v5h-5M9 20H4v-5',
  help: 'M9 9a3 3 0 1 1 4.5 2.6c-1 .6-1.5 1.2-1.5 2.4M12 17.6v.1',
};

/** Told that its panel opens or closes; a promise where it loads what belongs into the panel. */
type Changed = (open: boolean) => void | Promise<void>;

interface Panel {
  box: HTMLElement;
  body: HTMLElement;
  button: HTMLButtonElement;
  changed: Changed | undefined;
}

export class Panels {
  private readonly panels = new Map<RailName, Panel>();
  private opened: RailName | null = null;
  private isEntered = false; // or the keyboard was moved elsewhere
  private from: Element | null = null; // had the keyboard when it was opened

  /** `made`: told of each panel's box, closed. */
  constructor(private readonly made: (box: HTMLElement) => void) {
    // Whoever opens a panel by keys goes into it next, not through the other tools before.
    document.addEventListener('keydown', (event) => {
      if (event.key !== 'Tab' || this.opened === null || this.isEntered) return;
      const isNext = document.activeElement === this.from && !event.shiftKey;
      this.isEntered = true;
      if (!isNext) return;
      event.preventDefault();
      const inside = this.panels.get(this.opened)!.box.querySelectorAll<HTMLElement>('button, input, select, a[href]');
      [...inside].find((e) => e.checkVisibility())?.focus();
    });
  }

  /** A button that does something at once. */
  action(name: RailName, act: () => void): HTMLButtonElement {
    const button = railButton(name);
    button.onclick = act;
    element('rail').append(button);
    return button;
  }

  /** A button that opens and closes a panel; the panel's content is the caller's. */
  panel(name: RailName, title: string, changed?: Changed): HTMLElement {
    const button = this.action(name, () => this.toggle(name));
    const close = make('button', { type: 'button', className: 'close', title: text.close, onclick: () => this.close() }, '×');
    close.setAttribute('aria-label', text.close);
    const body = make('div', { className: 'body' });
    const box = make('aside', { id: `panel-${name}`, hidden: true }, make('header', {}, make('h2', {}, title), close), body);
    box.setAttribute('aria-label', title);
    element('panels').append(box);
    this.made(box);
    button.setAttribute('aria-expanded', 'false');
    button.setAttribute('aria-controls', box.id);
    this.panels.set(name, { box, body, button, changed });
    return body;
  }

  get open(): RailName | null {
    return this.opened;
  }

  toggle(name: RailName): void {
    const open = this.opened !== name;
    this.close();
    if (open) this.set(name, true);
  }

  show(name: RailName): void {
    if (this.opened !== name) this.toggle(name);
  }

  close(): boolean {
    const was = this.opened;
    if (was !== null) this.set(was, false);
    return was !== null;
  }

  private set(name: RailName, open: boolean): void {
    const panel = this.panels.get(name)!;
    this.opened = open ? name : null;
    document.body.classList.toggle('with-panel', open);
    if (open) {
      this.from = document.activeElement;
      this.isEntered = false;
    } else if (panel.box.contains(document.activeElement)) {
      const { from } = this;
      const isThere = from instanceof HTMLElement && from !== document.body && from.checkVisibility();
      (isThere ? from : panel.button).focus(); // keys go on from where they began
    }
    panel.box.hidden = !open;
    panel.button.setAttribute('aria-expanded', String(open));
    this.load(panel, open);
  }

  private load(panel: Panel, open: boolean): void {
    panel.changed?.(open)?.then(
      () => panel.body.querySelector('.failed')?.remove(),
      () => {
        // It says so in place of what is missing.
        const retry = textButton(text.retry, text.retryTitle, () => this.load(panel, !panel.box.hidden));
        const failed = make('div', { className: 'failed' }, make('p', {}, text.panelFailed), retry);
        failed.setAttribute('role', 'alert');
        const focused = panel.body.querySelector('.failed')?.contains(document.activeElement) === true;
        panel.body.replaceChildren(failed);
        if (focused) retry.focus();
      },
    );
  }
}

function railButton(name: RailName): HTMLButtonElement {
  const svg = document.createElementNS('http://www.w3.org/2000/svg', 'svg');
  svg.setAttribute('viewBox', '0 0 24 24');
  svg.setAttribute('aria-hidden', 'true');
  const path = document.createElementNS('http://www.w3.org/2000/svg', 'path');
  path.setAttribute('d', kIcons[name]);
  svg.append(path);
  const button = make('button', { type: 'button', id: `tool-${name}`, title: text.rail[name] });
  button.setAttribute('aria-label', text.rail[name]);
  button.append(svg);
  return button;
}
