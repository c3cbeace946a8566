// SPDX-License-Identifier: Apache-2.0
// Parts of the page that are loaded when they are needed first, or behind the first picture: the list of streams, measuring,
// what is taken away, statistics, headsets.
import type { Measurement } from './measure';
import type { MeasurePanel } from './measurePanel';
import type { Meter } from './meter';
import type { Panels } from './panels';
import type { StreamInfo, StreamStatus } from './protocol';
import type { Kept } from './source';
import type { StatisticsPanel } from './statisticsPanel';
import type { Measured as Shared } from './share';
import type { StreamsPanel, StreamsPanelEvents } from './streamsPanel';
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

export class Streams {
  panel: StreamsPanel | null = null; // once it was opened

  /** `changed`: told that there is more, or less, to be shown. */
  constructor(panels: Panels, events: StreamsPanelEvents, view: View | null, changed: () => void) {
    const body = panels.panel('streams', text.streams.title, async (open) => {
      const { StreamsPanel } = await import('./streamsPanel');
      this.panel ??= new StreamsPanel(body, events, view);
      this.panel.open = open;
      changed();
    });
  }
}

export interface Measured {
  readonly view: View;
  /** Where in the camera's picture the cursor is. */
  pointed(at: [number, number] | null): void;
  /** What is known of a stream. */
  described(stream: string): StreamInfo | null;
  /** Of the frame that is shown: those of one came one after the other. */
  run(): string;
  /** The panel was opened, or closed. */
  opened(open: boolean): void;
}

/** Measuring, and what is said of the place under the cursor. */
export class Measuring {
  private panel: MeasurePanel | null = null;
  private readonly body: HTMLElement;
  private given: readonly [Shared, readonly string[]] | null = null; // by a link, until the panel is there
  isOpen = false;

  constructor(
    private readonly panels: Panels,
    private readonly of: Measured,
  ) {
    this.body = panels.panel('measure', text.measure.title, async (open) => {
      this.isOpen = open;
      of.opened(open);
      await this.load();
      this.panel!.open = this.isOpen; // by now
    });
  }

  /** From now on what is under the cursor is said. */
  async load(): Promise<void> {
    const { MeasurePanel } = await import('./measurePanel');
    const { view, pointed, described, run } = this.of;
    this.panel ??= new MeasurePanel(this.body, view, pointed, described, run);
    const { given } = this;
    this.given = null;
    if (given !== null) this.panel.restore(...given);
  }

  /** Shows what a link says, of these streams, in place of what was measured before; where it says nothing, that stays. */
  restore(shared: Shared, streams: readonly string[]): void {
    if (shared.measurements.length === 0 && shared.flatness === null) return;
    this.given = [shared, streams];
    if (this.isOpen) void this.load().catch(() => undefined); // its panel says so and tries again
    else this.panels.show('measure');
  }

  /** For a link to these streams. */
  shared(streams: readonly string[]): Shared {
    return this.panel?.shared(streams) ?? { measurements: [], flatness: null };
  }

  get measurements(): readonly Measurement[] {
    return this.panel?.measurements ?? [];
  }
  get flatness(): Record<string, unknown> | null {
    return this.panel?.flat ?? null;
  }
  /** After each drawing of a new surface; `first`: of what a link was made of. */
  readCursor(first: boolean): void {
    if (first) this.panel?.cutAnew();
    this.panel?.readCursor();
  }
}

/** Browsers have WebXR in secure contexts alone. `failed` is told why it could not be entered. */
export async function addImmersive(view: View, failed: (why: string) => void): Promise<void> {
  const { xr } = navigator;
  if (xr === undefined) return;
  const { Immersive } = await import('./immersive');
  new Immersive(xr, view, failed);
}

const kAskMs = 5000; // whether a picture is on its way
const kIdleWithinMs = 2000;

const loadPanels = () => Promise.all([import('./streamsPanel'), import('./statisticsPanel'), import('./takePanel')]);
const loadSaving = () => Promise.all([import('./rangeExport'), import('./cdrWriter'), import('./surfaceFiles')]);

/** Loads what nobody has asked for yet, and keeps the page for when its server is not there; behind the first picture, or where none comes. */
export class Rest {
  private begun = false;

  /** `coming`: a picture is on its way, however slow the link; it is told to begin(). */
  constructor(
    private readonly measuring: Measuring | null,
    coming: () => boolean,
  ) {
    const asking = window.setInterval(() => {
      if (!this.begun && coming()) return;
      window.clearInterval(asking);
      this.begin();
    }, kAskMs);
  }

  /** There is a picture. */
  begin(): void {
    if (this.begun) return;
    this.begun = true;
    if ('requestIdleCallback' in window) requestIdleCallback(() => this.load(), { timeout: kIdleWithinMs });
    else setTimeout(() => this.load());
  }

  private load(): void {
    void this.measuring?.load().catch(() => undefined); // its panel says so and tries again
    // Only in secure contexts keeps the browser the page. Elsewhere it has to have by now what saves what it has received, and
    // its panels: a part that once did not come Firefox does not ask for again.
    if (!('serviceWorker' in navigator)) Promise.all([loadPanels(), loadSaving()]).catch(() => undefined);
    else if (import.meta.env.PROD) void navigator.serviceWorker.register('sw.js').catch(() => undefined);
  }
}
