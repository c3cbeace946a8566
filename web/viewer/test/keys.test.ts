// SPDX-License-Identifier: Apache-2.0
// Proves: a key that is held down does again and again what goes on with each press, and once what goes to and fro.
import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import { listenToKeys } from '../src/keys';

const actions = { mode: vi.fn(), way: vi.fn(), orbit: vi.fn(), pan: vi.fn(), zoom: vi.fn(), command: vi.fn((key: string) => key !== 'z') };
const page = new EventTarget();

beforeEach(() => {
  for (const element of ['Select', 'TextArea', 'Input', 'Button']) vi.stubGlobal(`HTML${element}Element`, class {});
  vi.clearAllMocks();
});
afterEach(() => void vi.unstubAllGlobals());
listenToKeys(actions, page);

/** Pressed, and held down for two repeats; how many of the three the page keeps from the browser. */
function hold(key: string, modifiers: object = {}): number {
  const events = [false, true, true].map((repeat) => Object.assign(new Event('keydown', { cancelable: true }), { key, repeat, getModifierState: (name: string) => name in modifiers, ...modifiers }));
  for (const event of events) page.dispatchEvent(event);
  return events.filter(({ defaultPrevented }) => defaultPrevented).length;
}

it.each(['x', 'X', 'm', 'f', 'h', 'v', ' ', '[', ']', '\\', '<', '?', 'Escape', 'Home'])('%j held down is one press', (key) => {
  expect(hold(key)).toBe(3);
  expect(actions.command).toHaveBeenCalledOnce();
});

it('steps, turns and zooms as long as it is held down', () => {
  for (const key of [',', '.']) expect(hold(key)).toBe(3);
  expect(actions.command).toHaveBeenCalledTimes(6);
  for (const key of ['+', '-', '=', '_', 'ArrowLeft']) expect(hold(key)).toBe(3);
  expect(actions.zoom).toHaveBeenCalledTimes(12);
  expect(actions.orbit).toHaveBeenCalledTimes(3);
});

it('takes brackets however a keyboard has them: by AltGr, which some systems call control and alt, or by option', () => {
  for (const modifiers of [{ AltGraph: true, ctrlKey: true, altKey: true }, { AltGraph: true }, { altKey: true }]) {
    for (const key of ['[', ']', '\\']) expect(hold(key, modifiers)).toBe(3);
  }
  expect(actions.command.mock.calls.map(([key]) => key).join('')).toBe('[]\\'.repeat(3));
  for (const modifiers of [{ ctrlKey: true }, { metaKey: true, altKey: true }, { AltGraph: true, metaKey: true }]) expect(hold('[', modifiers)).toBe(0);
});

it('leaves the browser what it does not know, and what is its own', () => {
  expect(hold('z')).toBe(0);
  for (const modifier of ['ctrlKey', 'metaKey', 'altKey']) expect(hold('x', { [modifier]: true })).toBe(0);
  expect(actions.command).toHaveBeenCalledOnce();
});
