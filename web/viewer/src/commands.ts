// SPDX-License-Identifier: Apache-2.0
// What keys and a double-click do.
import { kSplits, type Display } from './display';
import { listenToKeys } from './keys';
import type { Panels } from './panels';
import { moved } from './rigid';
import type { View } from './view';

export interface Commanded {
  readonly view: View | null;
  readonly panels: Panels;
  readonly display: Display;
  readonly record: { toggle(): void };
  /** command(): true where it has such a key. */
  readonly timeline: { command(key: string): boolean };
  change(part: Partial<Display>): void;
}

export function listenToCommands(viewer: Commanded, canvas: HTMLElement): void {
  const navigator = viewer.view?.navigator;
  listenToKeys({
    mode: (mode) => viewer.change({ mode }),
    way: (way) => viewer.change({ way }),
    orbit: (right, up) => navigator?.orbit(right, up),
    pan: (right, up) => navigator?.pan(right, up),
    zoom: (factor) => navigator?.zoom(factor),
    command: (key) => command(viewer, key),
  });
  canvas.addEventListener('dblclick', (event) => {
    const hit = viewer.view?.pick({ x: event.offsetX, y: event.offsetY }) ?? null;
    if (hit === null) return;
    navigator?.setPivot(moved(hit.pose, hit.point));
  });
}

export function toggleFullscreen(): void {
  const done = document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen();
  done.catch(() => undefined); // refused by the browser: nothing changes
}

function command(viewer: Commanded, key: string): boolean {
  const { view, panels, display } = viewer;
  const commands: Record<string, () => void> = {
    r: () => view?.navigator.reset(),
    f: toggleFullscreen,
    h: () => {
      // What had the focus may be hidden.
      if (document.body.classList.toggle('bare') && document.activeElement !== document.body) view?.canvas.focus();
    },
    g: () => viewer.change({ grid: !display.grid }),
    v: () => viewer.change({ split: kSplits[(kSplits.indexOf(display.split) + 1) % kSplits.length]! }),
    b: () => panels.toggle('display'),
    n: () => panels.toggle('streams'),
    m: () => panels.toggle('measure'),
    i: () => panels.toggle('statistics'),
    t: () => panels.toggle('take'),
    x: () => viewer.record.toggle(),
    '?': () => panels.toggle('help'),
    escape: () => panels.close(),
  };
  commands[key]?.();
  return commands[key] !== undefined || viewer.timeline.command(key);
}
