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

const pointer = (type: string, x: number, button = 0): Event =>
  Object.assign(new Event(type), { pointerId: 1, pointerType: 'mouse', button, clientX: x, clientY: 300, pageX: x, pageY: 300 });

/** Of a subject a metre away; `changed`: a drawing is wanted. */
function navigatorOf(canvas: Canvas, changed: () => void): Navigator {
  const of = new Navigator(canvas as unknown as HTMLCanvasElement, { changed, way: () => undefined }, new EventTarget());
  of.restart(rig, false);
  of.resize({ width: 1100, height: 680 });
  of.setExtent({ min: [-0.2, -0.3, 0.9], max: [0.3, 0.3, 1.2], centre: [0.05, 0, 1], depths: [0.9, 1.2] });
  return of;
}

/** How long the view moves behind a drag, drawn every so many milliseconds, and what it comes to. */
function drag(period_ms: number): { ms: number; position: number[] } {
  let wanted = false;
  const canvas = new Canvas();
  const of = navigatorOf(canvas, () => (wanted = true));
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

it('follows what is dragged aside however small the steps', () => {
  let wanted = false;
  const canvas = new Canvas();
  const of = navigatorOf(canvas, () => (wanted = true));
  let now = 5000;
  const rest = (): void => {
    for (; wanted; now += 16) {
      wanted = false;
      of.update(now);
    }
  };
  rest();
  const { position: from, target } = of.pose;
  const distance = Math.hypot(...from.map((c, i) => c - target[i]!));
  canvas.dispatchEvent(pointer('pointerdown', 500, 2));
  for (let x = 501; x <= 510; ++x) {
    canvas.dispatchEvent(pointer('pointermove', x, 2));
    expect(wanted, `a drawing for the step to ${x}`).toBe(true);
    rest();
  }
  canvas.dispatchEvent(pointer('pointerup', 510, 2));
  rest();
  const pixel = (distance * rig.height) / rig.fy / canvas.clientHeight;
  const moved = Math.hypot(...of.pose.position.map((c, i) => c - from[i]!)) / pixel;
  expect(Math.abs(moved - 10), `${moved} pixels, not 10`).toBeLessThan(1.5); // less is not worth a drawing
  canvas.dispatchEvent(pointer('pointermove', 600, 2)); // nothing is held
  expect(wanted).toBe(false);
  of.end();
});

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
