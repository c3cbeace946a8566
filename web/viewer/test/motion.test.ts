// SPDX-License-Identifier: Apache-2.0
// Proves: what is left of a drag dies away in the same time, and leads to the same view, however often the page draws.
import { afterAll, beforeAll, expect, it, vi } from 'vitest';
import { Navigator } from '../src/navigator';

let calm = false; // asked of the system
beforeAll(() => void vi.stubGlobal('window', Object.assign(new EventTarget(), { matchMedia: () => ({ matches: calm }) })));
afterAll(() => void vi.unstubAllGlobals());

const kLongest_ms = 2500;
const rig = { width: 640, height: 480, fx: 800, fy: 800, cx: 320, cy: 240 };

class Canvas extends EventTarget {
  readonly style = {};
  readonly ownerDocument = new EventTarget();
  readonly clientHeight = 680;
  setPointerCapture(): void {}
  releasePointerCapture(): void {}
  getRootNode(): EventTarget {
    return this;
  }
}

const pointer = (type: string, x: number): Event =>
  Object.assign(new Event(type), { pointerId: 1, pointerType: 'mouse', button: 0, clientX: x, clientY: 300, pageX: x, pageY: 300 });

/** How long the view moves behind a drag, drawn every so many milliseconds, and what it comes to. */
function drag(period_ms: number): { ms: number; position: number[] } {
  let wanted = false;
  const canvas = new Canvas();
  const of = new Navigator(canvas as unknown as HTMLCanvasElement, { changed: () => (wanted = true), way: () => undefined }, new EventTarget());
  of.restart(rig, false);
  of.resize({ width: 1100, height: 680 });
  of.setExtent({ min: [-0.2, -0.3, 0.9], max: [0.3, 0.3, 1.2], centre: [0.05, 0, 1], depths: [0.9, 1.2] });
  let now = 5000; // at rest before
  of.update(now);
  canvas.dispatchEvent(pointer('pointerdown', 500));
  for (const x of [520, 560, 600]) canvas.dispatchEvent(pointer('pointermove', x));
  canvas.dispatchEvent(pointer('pointerup', 600));
  expect(wanted).toBe(true);
  const begin = now;
  for (; wanted && now < begin + 1e5; now += period_ms) {
    wanted = false;
    of.update(now);
  }
  of.end();
  return { ms: now - begin, position: of.pose.position };
}

it('ends with the drag for who wants less motion, and leads to the same view', () => {
  const common = drag(1000 / 60);
  calm = true;
  const now = drag(1000 / 60);
  calm = false;
  expect(now.ms).toBeLessThan(50);
  for (const i of [0, 1, 2]) expect(Math.abs(now.position[i]! - common.position[i]!)).toBeLessThan(2e-3);
});

it.each([4, 8.3, 33, 100, 800])('drawn every %d ms', (period_ms) => {
  const [common, now] = [drag(1000 / 60), drag(period_ms)];
  expect(now.ms).toBeLessThan(kLongest_ms + 2 * period_ms);
  expect(now.ms).toBeGreaterThan(common.ms / 2);
  // A millimetre or two of a metre are not worth a drawing.
  for (const i of [0, 1, 2]) expect(Math.abs(now.position[i]! - common.position[i]!)).toBeLessThan(2e-3);
});
