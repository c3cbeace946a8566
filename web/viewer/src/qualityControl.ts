// SPDX-License-Identifier: Apache-2.0
// How much detail the server sends: what a person wants of what the stream offers, and what comes now.
import { make, setText } from './dom';
import { kRungs, type Quality, type Rung } from './protocol';
import { text } from './strings';

const say = text.quality;

export interface Offered {
  readonly want: Quality | null; // null: nobody has chosen, and full comes
  readonly now: Rung;
  readonly of: readonly Rung[];
  readonly offline?: boolean; // nothing comes
}

/** What there is to choose; what is wanted stays in it where the stream has it no more. */
export function choices({ want, of }: Offered): Quality[] {
  return [...(of.length > 1 || want === 'auto' ? (['auto'] as const) : []), ...kRungs.filter((r) => of.includes(r) || r === want)];
}

/** One line: what comes now, and why. */
export function whyText({ want, now, of, offline }: Offered): string {
  if (offline === true) return say.offline;
  const lower = of.length > 1;
  if (!lower && now === 'full') return want === null || want === 'full' || want === 'auto' ? say.only : say.missing(say.names[want]);
  if (want === null) return say.notChosen(say.names[now]);
  if (want === 'auto') return now === 'full' ? say.autoFull : say.autoLess(say.names[now]);
  if (want === now) return say.asChosen(say.names[now]);
  return of.includes(want) ? say.soon(say.names[now], say.names[want]) : say.missing(say.names[want]);
}

export class QualityControl {
  private readonly select: HTMLSelectElement;
  private readonly row: HTMLElement;
  private readonly why = make('p', { className: 'quiet', id: 'quality-why' });
  private listed = '';

  constructor(body: HTMLElement, chosen: (quality: Quality) => void) {
    this.select = make('select', { id: 'quality', onchange: () => chosen(this.select.value as Quality) });
    this.select.setAttribute('aria-describedby', this.why.id);
    this.why.setAttribute('role', 'status');
    this.row = make('label', { className: 'row' }, make('span', {}, say.label), this.select);
    body.append(this.row, this.why);
  }

  /** Null: what is shown is no live stream. */
  show(offered: Offered | null): void {
    this.row.hidden = this.why.hidden = offered === null;
    if (offered === null) return;
    const names = choices(offered);
    // Only where it differs: a list that is open stays open.
    if (names.join() !== this.listed) {
      this.listed = names.join();
      this.select.replaceChildren(...names.map((value) => make('option', { value }, say.names[value])));
    }
    const wanted = offered.want ?? 'full';
    if (this.select.value !== wanted) this.select.value = wanted;
    setText(this.why, whyText(offered));
  }
}
