// SPDX-License-Identifier: Apache-2.0
// The sheet of keys.
import { make } from './dom';
import { text } from './strings';

export function fillHelp(body: HTMLElement): void {
  const { help } = text;
  for (const [title, keys] of [
    [help.view, help.viewKeys],
    [help.show, help.showKeys],
    [help.time, help.timeKeys],
    [help.measure, help.measureKeys],
    [help.panels, help.panelKeys],
  ] as const) {
    const list = make('dl', {});
    for (const [key, does] of keys) list.append(make('dt', {}, key), make('dd', {}, does));
    body.append(make('h3', {}, title), list);
  }
}
