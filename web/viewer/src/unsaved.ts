// SPDX-License-Identifier: Apache-2.0
// What only this page has: until it is saved, the browser asks before the page is left.

const unsaved = new Set<object>();
const ask = (event: BeforeUnloadEvent): void => event.preventDefault();

/** Until mayLeave(). */
export function askBeforeLeaving(what: object): void {
  unsaved.add(what);
  window.addEventListener('beforeunload', ask);
}

export const hasUnsaved = (): boolean => unsaved.size > 0;

/** It is saved, or lost. */
export function mayLeave(what: object): void {
  unsaved.delete(what);
  if (unsaved.size === 0) window.removeEventListener('beforeunload', ask); // which keeps a page out of the browser's memory of pages
}
