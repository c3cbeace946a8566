// SPDX-License-Identifier: Apache-2.0
// Goes with a person through a calibration: what to do, a button that takes a view, what became of each, the
// result.
import { button, chooser, make, setText, toggle } from '../dom';
import { sentence } from '../sentence';
import { BoardField } from './boardField';
import {
  calibrationNow,
  orderCalibration,
  startCalibration,
  type Action,
  type Calibration,
  type Kind,
} from './calibration';
import { isGood, resultOf } from './calibrationResult';
import { card } from './cards';
import { Refused } from './look';
import { text } from './strings';

const say = text.calibration;
const kEveryMs = 1500;
const kEveryWhileUnderWayMs = 250;

/** What to do with a result, where there is one. */
const bestOf = ({ result }: Calibration): 'keep' | 'more' => (result !== null && !isGood(result) ? 'more' : 'keep');

export class CalibrationCard {
  private readonly next = make('p', { className: 'next', id: 'calibration-next' });
  private readonly message = make('p', { id: 'calibration-message', tabIndex: -1 });
  private readonly views = make('ol', { className: 'views', id: 'calibration-views' });
  private readonly result = make('div', { id: 'calibration-result' });
  private kind: Kind = 'colour';
  private readonly kinds = chooser(say.what, [
    ['colour', say.kinds.colour],
    ['geometry', say.kinds.geometry],
  ] as const, (kind) => {
    this.kind = kind;
    this.showKind();
  }).row;
  private readonly board = new BoardField();
  private readonly about = make('p', { className: 'quiet' });
  private readonly choice = make(
    'div',
    { className: 'controls' },
    this.kinds,
    this.board.root,
    this.about,
    button(say.start, say.startTitle, () => void this.start()),
  );
  private readonly rest = make('meter', { min: 0 });
  private readonly restText = make('span', { className: 'quiet' });
  private readonly restRow = make('p', { className: 'rest' }, this.rest, this.restText);
  private readonly automatic = toggle(say.automatic, (on) => void this.order(on ? 'automatic' : 'manual'));
  private readonly buttons = {
    take: this.action('take'),
    calculate: this.action('calculate'),
    keep: this.action('keep'),
    more: this.action('more'),
    cancel: this.action('cancel'),
  };
  private readonly controls = make('div', { className: 'controls' }, ...Object.values(this.buttons), this.automatic.row);
  readonly root = card(
    'calibration',
    say.title,
    this.next,
    this.restRow,
    this.message,
    this.choice,
    this.controls,
    this.result,
    this.views,
  );
  private told: Calibration | null = null;
  private answers = 0; // to orders; what was asked for before one may say what was before it
  private shownViews = '';
  private shownResult = '';
  private restarted = false; // a server in the middle of a calibration, which is lost
  private focused: HTMLElement | null = null; // before the server went away

  /** `changed` is called when a calibration begins or ends. */
  constructor(
    private readonly stream: () => string | null,
    private readonly changed: () => void,
  ) {
    this.next.setAttribute('role', 'status');
    this.message.setAttribute('role', 'status');
    this.views.setAttribute('aria-live', 'polite');
    this.rest.setAttribute('aria-hidden', 'true'); // the text beside it says it
    this.root.hidden = true;
    this.showKind();
    void this.follow();
  }

  /** No server answers. */
  get away(): boolean {
    return this.root.inert;
  }

  /** The calibration that is under way. */
  get underWay(): Calibration | null {
    return this.told === null || this.told.state === 'off' ? null : this.told;
  }

  private action(action: keyof typeof say.actions): HTMLButtonElement {
    const [label, title] = say.actions[action];
    const made = button(label, title, () => void this.order(action));
    made.dataset['action'] = action;
    return made;
  }

  private showKind(): void {
    this.board.root.hidden = this.kind !== 'geometry';
    setText(this.about, say.about[this.kind]);
  }

  // Also while the page is hidden: who stands at the rig may look at something else, and what nobody asks
  // about is given up.
  private async follow(): Promise<void> {
    const { answers } = this;
    try {
      const told = await calibrationNow();
      if (answers === this.answers) this.tell(told);
    } catch (error) {
      if (!(error instanceof Refused)) this.showAway(true);
    }
    window.setTimeout(() => void this.follow(), this.underWay === null || this.away ? kEveryMs : kEveryWhileUnderWayMs);
  }

  // What is shown is of before, and no button does anything.
  private showAway(away: boolean): void {
    if (away === this.away) return;
    if (away) this.focused = this.focusWithin;
    this.root.inert = away;
    setText(this.message, text.state.lost);
    this.message.hidden = false;
    this.message.classList.add('bad');
    if (!away && this.told !== null) this.tellMessage(this.told);
    if (!away) this.focused?.focus();
  }

  private get focusWithin(): HTMLElement | null {
    const { activeElement } = document;
    return activeElement instanceof HTMLElement && this.root.contains(activeElement) ? activeElement : null;
  }

  private start(): Promise<void> {
    return this.answer(startCalibration(this.stream()!, this.kind, this.board.value));
  }

  private order(action: Action): Promise<void> {
    return this.answer(orderCalibration(action));
  }

  private async answer(asked: Promise<Calibration>): Promise<void> {
    try {
      const told = await asked;
      ++this.answers;
      this.tell(told);
    } catch (error) {
      setText(this.message, error instanceof Refused ? sentence(error.message) : text.state.lost);
      this.message.hidden = false;
      this.message.classList.add('bad');
    }
  }

  private tell(told: Calibration): void {
    this.showAway(false);
    const was = this.underWay !== null;
    const before = this.told;
    const held = this.focusWithin;
    // A server that knows of none was started since.
    this.restarted = told.stream === '' && (was || this.restarted);
    this.told = told;
    const on = this.underWay !== null;
    this.root.hidden = !on && this.stream() === null; // there is nothing to calibrate yet
    this.root.dataset['state'] = told.state;
    this.choice.hidden = on;
    this.controls.hidden = !on;
    setText(this.next, told.next);
    this.next.hidden = !on;
    if (before === null || before.message !== told.message || before.state !== told.state) this.tellMessage(told);
    this.tellRest(told);
    this.tellButtons(told);
    this.tellViews(told);
    if (was !== on) this.changed();
    if (before?.state !== told.state) this.moveFocus(told, before, held);
    if (was && this.restarted) this.message.scrollIntoView({ block: 'center' }); // other cards are above it again
  }

  // Whoever has no mouse stays with what is to be done next.
  private moveFocus(told: Calibration, before: Calibration | null, held: HTMLElement | null): void {
    if (told.state === 'watching' && before?.state === 'pausing') this.buttons.take.focus();
    else if (told.state === 'solved') this.buttons[bestOf(told)].focus();
    else if (held !== null && this.controls.contains(held)) {
      if (told.state === 'off') this.message.focus();
      else if (told.state === 'watching') this.buttons.take.focus({ preventScroll: true });
    }
  }

  private tellMessage(told: Calibration): void {
    const message = this.restarted ? say.restarted : sentence(told.message);
    setText(this.message, message);
    this.message.hidden = message === '';
    this.message.classList.toggle('bad', message !== '' && (told.failed || this.restarted || this.underWay !== null));
  }

  private tellRest(told: Calibration): void {
    this.restRow.hidden = told.state !== 'watching';
    this.rest.max = Math.max(1, told.cycle);
    this.rest.value = told.at_rest;
    setText(this.restText, told.armed ? say.waits(told.at_rest, told.cycle) : say.rest(told.at_rest, told.cycle));
  }

  private tellButtons(told: Calibration): void {
    const { take, calculate, keep, more } = this.buttons;
    const watching = told.state === 'watching' || told.state === 'busy';
    const geometry = told.kind === 'geometry';
    const waited = take.disabled;
    take.hidden = !watching;
    take.disabled = told.state !== 'watching' || told.armed;
    if (waited && !take.disabled && document.activeElement === document.body) take.focus({ preventScroll: true }); // it lost it
    take.classList.toggle('first', !told.enough);
    calculate.hidden = !watching || !geometry;
    calculate.disabled = told.state !== 'watching' || !told.can_calculate;
    calculate.classList.toggle('first', told.enough);
    keep.hidden = more.hidden = told.state !== 'solved';
    for (const action of ['keep', 'more'] as const) this.buttons[action].classList.toggle('first', action === bestOf(told));
    this.automatic.row.hidden = !watching || !geometry;
    this.automatic.set(told.automatic);
  }

  private tellViews(told: Calibration): void {
    const views = JSON.stringify([told.views, told.result === null]);
    if (views !== this.shownViews) {
      this.shownViews = views;
      // The last one first: it is what the person has just done.
      this.views.replaceChildren(
        ...[...told.views].reverse().map(({ name, used, says }) => {
          const mark = make('span', { className: used ? 'used' : 'bad' }, used ? say.used : say.notUsed);
          const row = make('li', {}, make('strong', {}, name), ' ', mark, make('span', { className: 'quiet' }, says));
          row.dataset['used'] = String(used);
          return row;
        }),
      );
    }
    const title = told.kind === '' ? '' : say.resultOf(say.kinds[told.kind], told.state === 'off' ? told.file !== '' : null);
    const result = JSON.stringify([told.result, title]);
    if (result === this.shownResult) return;
    this.shownResult = result;
    this.result.replaceChildren(...(told.result === null ? [] : [make('h3', {}, title), ...resultOf(told.result)]));
  }
}
