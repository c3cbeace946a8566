// SPDX-License-Identifier: Apache-2.0
// The page's address: it says what of the server is shown, so that loading the page anew, and the browser's Back, show
// that again.
import type { Companions } from './companions';
import type { Display } from './display';
import type { Measuring } from './laterParts';
import type { Session } from './session';
import { address, goTo, momentOf, namesOf, shareLink, type Shared, type Shown } from './share';
import type { FrameSource } from './source';
import type { View } from './view';

/**
 * Null: what is shown is nothing of the server. `before`: was shown until a person chose this, and Back leads to it; null:
 * only more is known of what is shown, or nothing was. `keepsHash`: what is behind # is of it.
 */
export function sayShown(now: Shown | null, before: Shown | null, keepsHash: boolean): void {
  const url = address(location.href, now);
  if (!keepsHash) url.hash = '';
  if (before === null || (now?.kind === before.kind && now.name === before.name)) return history.replaceState(null, '', url);
  history.replaceState(null, '', address(location.href, before)); // the page may have chosen it, without a word here
  history.pushState(null, '', url);
}

export interface Linked {
  readonly view: View | null;
  readonly session: Session;
  readonly companions: Companions | null;
  readonly measure: Measuring | null;
  readonly display: Display;
  readonly shown: Shown | null;
}

/** A link to what is seen now. */
export function linkOf({ view, session, companions, measure, display, shown }: Linked): string {
  const navigator = view?.navigator;
  const pose = navigator === undefined || navigator.isRigView ? null : navigator.pose;
  const moment = momentOf(session.source?.playback ?? null);
  const names = companions?.names ?? [];
  const places = [...(view?.placedByHand ?? [])].filter(([name]) => names.includes(name));
  const measured = measure?.shared(shown === null ? [] : namesOf(address(location.href, shown).search));
  return shareLink(location.href, shown, display, pose, moment, new Map(places), measured);
}

/** What is shown already, from where and when a link sees it. */
export function seeAs({ pose, moment }: Shared, view: View | null, source: FrameSource | null): void {
  const navigator = view?.navigator;
  if (pose !== null && navigator?.isRigView === false) navigator.pose = pose;
  if (moment !== null && source !== null) goTo(source.playback, moment);
}
