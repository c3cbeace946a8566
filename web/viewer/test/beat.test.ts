// SPDX-License-Identifier: Apache-2.0
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { Beat } from '../src/beat';

/** A screen and a card whose time the test moves on. */
class Machine {
  readonly done: string[] = [];
  drawn = false; // the card has finished what it was asked for
  private frames: FrameRequestCallback[] = [];
  private timers: (() => void)[] = [];
  readonly gl = {
    SYNC_GPU_COMMANDS_COMPLETE: 1,
    SYNC_STATUS: 2,
    UNSIGNALED: 3,
    SIGNALED: 4,
    fenceSync: () => ({}),
    deleteSync: () => undefined,
    flush: () => undefined,
    getSyncParameter: () => (this.drawn ? 4 : 3),
  } as unknown as WebGL2RenderingContext;

  constructor() {
    vi.stubGlobal('requestAnimationFrame', (act: FrameRequestCallback) => this.frames.push(act));
    vi.stubGlobal('window', { setTimeout: (act: () => void) => this.timers.push(act) });
    vi.stubGlobal('document', { hidden: false });
  }

  frame(): void {
    for (const act of this.frames.splice(0)) act(0);
    this.done.push('together'); // the page is put together after what was asked for before it
  }
  tasks(): void {
    for (const act of this.timers.splice(0)) act();
  }
  beat(beside: boolean): Beat {
    return new Beat(this.gl, beside, {
      draw: () => this.done.push('draw'),
      show: () => this.done.push('show'),
      took: () => undefined,
    });
  }
}

let machine: Machine;
beforeEach(() => {
  machine = new Machine();
});
afterEach(() => vi.unstubAllGlobals());

describe('Beat', () => {
  it('draws once on the screen’s beat, however often it is asked', () => {
    const beat = machine.beat(false);
    beat.ask();
    beat.ask();
    machine.frame();
    machine.frame();
    expect(machine.done).toEqual(['draw', 'show', 'together', 'together']);
  });

  it('shows what is drawn beside the canvas when it is done, and not before', () => {
    const beat = machine.beat(true);
    beat.ask();
    machine.tasks();
    machine.tasks();
    machine.frame();
    expect(machine.done).toEqual(['draw', 'together']);
    machine.drawn = true;
    machine.tasks();
    machine.frame();
    expect(machine.done).toEqual(['draw', 'together', 'show', 'together']);
    expect(beat.isBusy).toBe(false);
  });

  it('never has a drawing under way while the page is put together with the one before', () => {
    const beat = machine.beat(true);
    beat.ask();
    machine.tasks();
    beat.ask(); // while the first is under way
    machine.drawn = true;
    machine.tasks();
    expect(machine.done).toEqual(['draw']);
    machine.frame();
    machine.tasks();
    expect(machine.done).toEqual(['draw', 'show', 'together', 'draw']);
    expect(beat.isBusy).toBe(true);
  });

  it('a hidden page draws nothing beside its canvas', () => {
    vi.stubGlobal('document', { hidden: true });
    const beat = machine.beat(true);
    beat.ask();
    machine.tasks();
    expect(machine.done).toEqual([]);
  });

  it('a card that was lost holds nothing up', () => {
    const beat = machine.beat(true);
    machine.gl.fenceSync = () => null;
    beat.ask();
    machine.tasks();
    machine.frame();
    expect(machine.done).toEqual(['draw', 'show', 'together']);
    expect(beat.isBusy).toBe(false);
  });

  it('stops for good', () => {
    const beat = machine.beat(true);
    beat.ask();
    beat.stop();
    machine.tasks();
    machine.frame();
    expect(machine.done).toEqual(['together']);
  });
});
