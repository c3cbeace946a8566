// SPDX-License-Identifier: Apache-2.0
// A panel that lies over much of the picture, as on a phone, folds to what matters there, so that what lies under it can be
// touched. Which windows those are, and what is left of the panel, stands in style.css.
import { button } from './dom';
import { text } from './strings';

export class Fold {
  private readonly button = button('▾', text.fold, () => this.set(!this.panel.classList.contains('folded')));

  /** `panel`: of Panels. */
  constructor(private readonly panel: HTMLElement) {
    this.button.className = 'fold';
    panel.querySelector('header .close')!.before(this.button);
    this.set(false);
  }

  /** Until a person unfolds it: by itself it would come under the finger that has just chosen a place, and be clicked. */
  fold(): void {
    this.set(true);
  }

  private set(folded: boolean): void {
    this.panel.classList.toggle('folded', folded);
    this.button.setAttribute('aria-expanded', String(!folded));
  }
}
