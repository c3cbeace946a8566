// SPDX-License-Identifier: Apache-2.0
// Elements of the page.

export const element = <T extends HTMLElement = HTMLElement>(id: string): T => {
  const found = document.getElementById(id);
  if (found === null) throw new Error(`the page has no #${id}`);
  return found as T;
};

/** The window that shows a node, which may be another than the code's own: its beat, its screen. */
export const windowOf = (node: Node): Window & typeof globalThis => node.ownerDocument?.defaultView ?? window;

type Child = Node | string;

/** An element with properties (not attributes) and children. */
export function make<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  properties: Partial<HTMLElementTagNameMap[K]> = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

export function setText(target: HTMLElement, text: string): void {
  if (target.textContent !== text) target.textContent = text;
}

export function button(text: string, title: string, onclick: () => void): HTMLButtonElement {
  const made = make('button', { type: 'button', title, onclick }, text);
  if (title !== '' && !/\p{L}|\d/u.test(text)) made.setAttribute('aria-label', title); // a sign says nothing to who hears it
  return made;
}

/** A labelled <select>; `changed` gets the value chosen. */
export function chooser<T extends string>(
  label: string,
  options: readonly (readonly [T, string])[],
  changed: (value: T) => void,
): { row: HTMLElement; set(value: T): void } {
  const select = make(
    'select',
    { onchange: () => changed(select.value as T) },
    ...options.map(([value, text]) => make('option', { value }, text)),
  );
  return { row: make('label', { className: 'row' }, make('span', {}, label), select), set: (v) => (select.value = v) };
}

export function toggle(
  label: string,
  changed: (on: boolean) => void,
): { row: HTMLElement; set(on: boolean): void } {
  const box = make('input', { type: 'checkbox', onchange: () => changed(box.checked) });
  return { row: make('label', { className: 'row' }, make('span', {}, label), box), set: (on) => (box.checked = on) };
}
