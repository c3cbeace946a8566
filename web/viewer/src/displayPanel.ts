// SPDX-License-Identifier: Apache-2.0
// The choices of how the surface is shown: the panel, the buttons for modes and ways, and the page's look.
import { kBackgrounds, kFov, kModes, kSplits, kThemes, kWays, type Display, type Mode, type Way } from './display';
import { button, chooser, element, make, toggle } from './dom';
import { text } from './strings';

export class DisplayPanel {
  private readonly modes: Map<Mode, HTMLButtonElement>;
  private readonly ways: Map<Way, HTMLButtonElement>;
  private readonly set: (display: Display) => void;
  private chosen = ''; // of both

  /** `change` gets what is to differ from now on. */
  constructor(body: HTMLElement, change: (part: Partial<Display>) => void) {
    this.modes = new Map(
      kModes.map((mode, i) => [mode, button(text.modes[mode], `${text.modes[mode]} (${i + 1})`, () => change({ mode }))]),
    );
    this.ways = new Map(kWays.map((way) => [way, button(...text.ways[way], () => change({ way }))]));
    element('modes').append(...this.modes.values());
    element('ways').append(...this.ways.values());
    // In low windows they are rows that are scrolled: also where one has just become so, or is shown again.
    const rows = new ResizeObserver(() => this.bringIntoSight());
    for (const row of ['modes', 'ways']) rows.observe(element(row));

    const say = text.display;
    const background = chooser(say.background, kBackgrounds.map((b) => [b, text.backgrounds[b]] as const), (value) =>
      change({ background: value }),
    );
    const theme = chooser(say.theme, kThemes.map((t) => [t, text.themes[t]] as const), (value) => change({ theme: value }));
    const grid = toggle(say.grid, (on) => change({ grid: on }));
    const smooth = toggle(say.smooth, (on) => change({ smooth: on }));
    const split = chooser(say.split, kSplits.map((s) => [s, text.splits[s]] as const), (value) => change({ split: value }));
    const fovValue = make('output', {});
    const fov = make('input', {
      type: 'range',
      min: String(kFov.least - 1),
      max: String(kFov.most),
      oninput: () => change({ fov: Number(fov.value) < kFov.least ? 0 : Number(fov.value) }),
    });
    fov.setAttribute('aria-label', say.fov); // a label is of the first it holds, the output
    const fovRow = make('label', { className: 'row' }, make('span', {}, say.fov, fovValue), fov);
    body.append(background.row, theme.row, fovRow, grid.row, smooth.row, split.row);
    this.set = (display) => {
      background.set(display.background);
      theme.set(display.theme);
      grid.set(display.grid);
      smooth.set(display.smooth);
      split.set(display.split);
      fov.value = String(display.fov || kFov.least - 1);
      fovValue.textContent = display.fov === 0 ? say.fovOfRig : `${display.fov}°`;
    };
  }

  show(display: Display, hasRig: boolean): void {
    for (const [mode, b] of this.modes) b.setAttribute('aria-pressed', String(mode === display.mode));
    for (const [way, b] of this.ways) b.setAttribute('aria-pressed', String(way === display.way));
    this.ways.get('camera')!.disabled = !hasRig;
    if (`${display.mode} ${display.way}` !== this.chosen) this.bringIntoSight();
    this.chosen = `${display.mode} ${display.way}`;
    this.set(display);
    const root = document.documentElement;
    root.dataset['theme'] = display.theme;
    root.dataset['background'] = display.background;
    document.body.dataset['split'] = display.split;
  }

  // However they were chosen.
  private bringIntoSight(): void {
    for (const b of [...this.modes.values(), ...this.ways.values()]) {
      if (b.getAttribute('aria-pressed') === 'true') b.scrollIntoView({ block: 'nearest', inline: 'nearest' });
    }
  }
}
