// SPDX-License-Identifier: Apache-2.0
// Parts of the page that are loaded when they are needed first: what is taken away, statistics, headsets.
import type { Meter } from './meter';
import type { Panels } from './panels';
import type { StreamStatus } from './protocol';
import type { Kept } from './source';
import type { StatisticsPanel } from './statisticsPanel';
import { text } from './strings';
import type { Takeable, TakePanel } from './takePanel';
import type { View } from './view';

export interface Told {
  readonly meter: Meter;
  status(): StreamStatus | null;
  kept(): Kept | null;
  /** In words, how much detail comes and why; null: no live stream is shown. */
  quality(): string | null;
}

export function addStatistics(panels: Panels, { meter, status, kept, quality }: Told): void {
  let panel: StatisticsPanel | null = null;
  let isOpen = false;
  const body = panels.panel('statistics', text.statistics.title, async (open) => {
    isOpen = open;
    const { StatisticsPanel } = await import('./statisticsPanel');
    panel ??= new StatisticsPanel(body, meter, status, kept, quality);
    panel.open = isOpen; // by now
  });
}

export function addTake(panels: Panels, of: Takeable): void {
  let panel: TakePanel | null = null;
  const body = panels.panel('take', text.take.title, async () => {
    const { TakePanel } = await import('./takePanel');
    panel ??= new TakePanel(body, of);
  });
}

/** Browsers have WebXR in secure contexts alone. `failed` is told why it could not be entered. */
export async function addImmersive(view: View, failed: (why: string) => void): Promise<void> {
  const { xr } = navigator;
  if (xr === undefined) return;
  const { Immersive } = await import('./immersive');
  new Immersive(xr, view, failed);
}
