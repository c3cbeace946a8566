// SPDX-License-Identifier: Apache-2.0
// A link that shows somebody else the same: stream, view and display. The part behind # is not sent to any server. Pure.
import { parseDisplay, writeDisplay, type Display } from './display';
import type { Pose } from './navigator';
import type { Vec3 } from './pick';

/** Over the address of the page; `pose` null: the first view. */
export function shareLink(page: string, stream: string | null, display: Display, pose: Pose | null): string {
  const url = new URL(page);
  url.search = '';
  if (stream !== null) url.searchParams.set('stream', stream);
  const state = writeDisplay(display, null);
  state.delete('theme'); // is the reader's own
  if (pose !== null) {
    const write = (v: Vec3): string => v.map((c) => Number(c.toFixed(4))).join('_');
    state.set('eye', write(pose.position));
    state.set('at', write(pose.target));
  }
  url.hash = state.toString();
  return url.href;
}

/** What a link's part behind # asks for; any input. */
export function readShared(hash: string, fallback: Display): { display: Display; pose: Pose | null } {
  const text = hash.replace(/^#/, '');
  const given = new URLSearchParams(text);
  const read = (key: string): Vec3 | null => {
    const numbers = (given.get(key) ?? '').split('_').map((part) => (part === '' ? NaN : Number(part)));
    return numbers.length === 3 && numbers.every((n) => Math.abs(n) < 1e4) ? (numbers as Vec3) : null;
  };
  const [position, target] = [read('eye'), read('at')];
  const apart = position !== null && target !== null && position.some((c, i) => Math.abs(c - target[i]!) > 1e-6);
  return { display: parseDisplay(text, fallback), pose: apart ? { position: position!, target: target! } : null };
}
