// SPDX-License-Identifier: Apache-2.0
// Keys for everything. What they do is the page's; which key does it stands here alone.
import { kModes, type Mode, type Way } from './display';
import { isTyping } from './fly';

const kTurn = 0.06; // radians a key press
const kMove = 0.03; // of the distance
const kZoom = 1.08;

export interface KeyActions {
  mode(mode: Mode): void;
  way(way: Way): void;
  orbit(right: number, up: number): void;
  pan(right: number, up: number): void;
  zoom(factor: number): void;
  /** By the key, lower case; false where it means nothing. */
  command(key: string): boolean;
}

const kArrows: Record<string, readonly [number, number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, 1],
  ArrowDown: [0, -1],
};
const kOnce = /^[^,.+=_-]$|^(Home|End|Escape)$/; // while it is held down: what goes to and fro with each press would flicker
const kWayKeys: Record<string, Way> = { o: 'orbit', y: 'fly', c: 'camera' };

export function listenToKeys(actions: KeyActions, of: EventTarget = window): void {
  let isActed = false; // by the key that is held down
  of.addEventListener('keydown', (e) => {
    const event = e as KeyboardEvent;
    // Closes panels from within them too.
    if (event.key !== 'Escape' && (isTyping(event.target) || belongsToControl(event))) return;
    if (isModified(event)) return;
    if (!event.repeat || !kOnce.test(event.key)) isActed = act(event, actions);
    if (isActed) event.preventDefault();
  });
}

// Many keyboards have brackets on a key's third level, which AltGr or a Mac's option key reaches.
function isModified(event: KeyboardEvent): boolean {
  if (event.getModifierState('AltGraph')) return event.metaKey;
  return event.ctrlKey || event.metaKey || (event.altKey && !'[]\\'.includes(event.key));
}

// Space and Enter press the button that has the focus, arrows move a slider, which Home and End take to its ends; that of time they take there as everywhere.
function belongsToControl({ target, key }: KeyboardEvent): boolean {
  if (target instanceof HTMLButtonElement) return key === ' ' || key === 'Enter';
  if (!(target instanceof HTMLInputElement)) return false;
  const isEnd = target.type === 'range' && /^(Home|End)$/.test(key) && target.closest('.track') === null;
  return key === ' ' || key.startsWith('Arrow') || isEnd;
}

function act(event: KeyboardEvent, actions: KeyActions): boolean {
  const arrow = kArrows[event.key];
  if (arrow !== undefined) {
    const [x, y] = arrow;
    if (event.shiftKey) actions.pan(x * kMove, y * kMove);
    else actions.orbit(x * kTurn, y * kTurn);
    return true;
  }
  const key = event.key.toLowerCase();
  const mode = kModes[Number(key) - 1];
  const way = kWayKeys[key];
  if (mode !== undefined) actions.mode(mode);
  else if (way !== undefined) actions.way(way);
  else if (key === '+' || key === '=') actions.zoom(kZoom);
  else if (key === '-' || key === '_') actions.zoom(1 / kZoom);
  else return actions.command(key);
  return true;
}
