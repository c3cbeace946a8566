// SPDX-License-Identifier: Apache-2.0
// The projector: what it shows, and buttons where the server drives it.
import { button, chooser, make, setText } from '../dom';

import { sentence } from '../sentence';
import { card } from './cards';
import { ask, Refused } from './look';
import { text } from './strings';

const say = text.projector;
const kEveryMs = 1500;
type Show = keyof typeof say.shows;

/** What GET and POST /api/projector answer. */
interface Projector {
  state: 'none' | 'off' | 'on' | 'failed';
  output: string;
  stream: string;
  show: string;
  message: string;
}

export class ProjectorCard {
  private readonly state = make('p', { id: 'projector-state' });
  private readonly message = make('p', { className: 'quiet', id: 'projector-message' });
  private show: Show = 'pattern';
  private answers = 0; // to orders; what was asked for before one may say what was before it
  private readonly start = button(
    say.start,
    say.start,
    () => void this.order({ action: 'start', stream: this.stream(), show: this.show }),
  );
  private readonly stop = button(say.stop, say.stop, () => void this.order({ action: 'stop' }));
  private readonly shows = chooser(
    say.show,
    (Object.keys(say.shows) as Show[]).map((show) => [show, say.shows[show]] as const),
    (show) => (this.show = show),
  ).row;
  private readonly controls = make('div', { className: 'controls', hidden: true }, this.shows, this.start, this.stop);
  readonly root = card('projector', say.title, this.state, this.controls, this.message);

  constructor(private readonly stream: () => string | null) {
    this.state.setAttribute('role', 'status');
    void this.follow();
  }

  private async follow(): Promise<void> {
    if (!document.hidden) {
      const { answers } = this;
      const told = await ask('api/projector')
        .then((response) => response.json() as Promise<Projector>)
        .catch(() => null);
      if (told !== null && answers === this.answers) this.tell(told);
      else if (told === null) this.root.hidden = true; // a gateway without a rig
    }
    window.setTimeout(() => void this.follow(), kEveryMs);
  }

  private async order(order: object): Promise<void> {
    try {
      const response = await ask('api/projector', {
        method: 'POST',
        headers: { 'content-type': 'application/json' },
        body: JSON.stringify(order),
      });
      const told = (await response.json()) as Projector;
      ++this.answers;
      this.tell(told);
    } catch (error) {
      setText(this.message, say.failed(error instanceof Refused ? error.message : text.state.lost));
    }
  }

  private tell(told: Projector): void {
    const on = told.state === 'on';
    this.root.hidden = false;
    this.root.dataset['state'] = told.state;
    const show = say.shows[told.show as Show] ?? told.show;
    setText(this.state, on ? say.on(told.output, show) : say.states[told.state]);
    setText(this.message, sentence(told.message));
    this.state.hidden = told.state === 'none'; // the message says it
    this.controls.hidden = told.state === 'none';
    this.stop.disabled = !on;
  }
}
