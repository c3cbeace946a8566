// SPDX-License-Identifier: Apache-2.0
// Flying: W A S D Q E held down move, dragging with the first button looks around.

const kSpeed = 0.6; // distances to the target a second
const kFast = 3; // times that with shift
const kLook = 0.004; // radians a pixel
const kLongest_ms = 100; // of a step, where drawing is slow

const kDirections: Record<string, [number, number, number]> = {
  KeyA: [-1, 0, 0],
  KeyD: [1, 0, 0],
  KeyQ: [0, -1, 0],
  KeyE: [0, 1, 0],
  KeyS: [0, 0, -1],
  KeyW: [0, 0, 1],
};

export interface FlyEvents {
  look(right: number, up: number): void;
  /** A key is held down: step() wants to be called. */
  moving(): void;
}

/** True where keys belong to what has the focus. */
export const isTyping = (target: EventTarget | null): boolean =>
  target instanceof HTMLSelectElement ||
  target instanceof HTMLTextAreaElement ||
  (target instanceof HTMLInputElement && target.type !== 'checkbox' && target.type !== 'range');

export class Fly {
  private readonly held = new Set<string>();
  private fast = false;
  private last = 0;
  private pointer: number | null = null;

  private readonly listening = new AbortController();

  /** `keys`: where they are listened to. */
  constructor(canvas: HTMLCanvasElement, events: FlyEvents, keys: EventTarget) {
    const { signal } = this.listening;
    const onKeyDown = (e: Event): void => {
      const event = e as KeyboardEvent;
      this.fast = event.shiftKey;
      const free = !event.ctrlKey && !event.metaKey && !event.altKey && !isTyping(event.target);
      if (!free || kDirections[event.code] === undefined) return;
      if (this.held.size === 0) this.last = performance.now();
      this.held.add(event.code);
      events.moving();
    };
    const onKeyUp = (e: Event): void => {
      this.fast = (e as KeyboardEvent).shiftKey;
      this.held.delete((e as KeyboardEvent).code);
    };
    keys.addEventListener('keydown', onKeyDown, { signal });
    keys.addEventListener('keyup', onKeyUp, { signal });
    // Where keys are listened to in a part of a page, those that are let go elsewhere are not heard.
    keys.addEventListener('focusout', () => this.held.clear(), { signal });
    window.addEventListener('blur', () => this.held.clear(), { signal });
    canvas.addEventListener('pointerdown', (event) => {
      this.pointer = event.button === 0 ? event.pointerId : null;
    });
    canvas.addEventListener('pointermove', (event) => {
      if (event.pointerId === this.pointer && event.buttons === 1) {
        events.look(event.movementX * kLook, -event.movementY * kLook);
      }
    });
  }

  /** For good. */
  end(): void {
    this.listening.abort();
  }

  /** Right, up and ahead since the last call, in distances to the target; null while no key is held. */
  step(now: number): [number, number, number] | null {
    if (this.held.size === 0) return null;
    const seconds = Math.min(now - this.last, kLongest_ms) / 1000;
    this.last = now;
    const move: [number, number, number] = [0, 0, 0];
    for (const code of this.held) {
      for (const [i, part] of kDirections[code]!.entries()) move[i]! += part * seconds * kSpeed * (this.fast ? kFast : 1);
    }
    return move;
  }
}
