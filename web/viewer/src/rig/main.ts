// SPDX-License-Identifier: Apache-2.0
// The page /rig: what a rig's camera sees and how well its stripes are read, while somebody sets it up. The
// server looks at frames only because this page asks, so it asks for what is seen alone, and not while it is
// hidden.
import { loadDisplay } from '../display';
import { button, element, make, setText } from '../dom';
import { sentence } from '../sentence';

import { calibrationPicture, type Calibration } from './calibration';
import { CalibrationCard } from './calibrationCard';
import { AdviceCard, ExposureCard, MarginsCard, StepCard, StripesCard } from './cards';
import { CoverageFigure } from './coverage';
import { draw } from './draw';
import { kPictures, lookAt, pictureOf, Refused, streamNames, type PictureName } from './look';
import { ProjectorCard } from './projector';
import { text } from './strings';

const kEveryMs = 200;
const kAgainMs = 1500; // after a failure

class RigPage {
  private readonly streams = element<HTMLSelectElement>('stream');
  private readonly canvas = element<HTMLCanvasElement>('picture');
  private readonly coverage = new CoverageFigure();
  private readonly buttons = new Map<PictureName, HTMLButtonElement>();
  private readonly calibration = new CalibrationCard(
    () => this.stream,
    () => this.calibrationChanged(),
  );
  private readonly cards = [new AdviceCard(), new ExposureCard(), new MarginsCard(), new StripesCard(), new StepCard()];
  private stream = new URLSearchParams(location.search).get('stream');
  private away: string | null = null; // that was calibrated and is not back yet
  private picture: PictureName = kPictures.find((name) => name === location.hash.slice(1)) ?? 'camera';

  constructor() {
    const { theme } = loadDisplay();
    if (theme !== 'auto') document.documentElement.dataset['theme'] = theme;
    for (const name of kPictures) {
      const [label, title] = text.pictures[name];
      const made = button(label, title, () => this.choose(name));
      this.buttons.set(name, made);
      element('pictures').append(made);
    }
    this.streams.onchange = () => {
      this.stream = this.streams.value;
      this.remember();
    };
    element('cards').append(
      ...this.cards.map(({ root }) => root),
      this.calibration.root,
      new ProjectorCard(() => this.stream).root,
    );
    this.choose(this.picture);
    this.say(text.state.connecting, 'waiting');
    void this.run();
  }

  private choose(name: PictureName): void {
    this.picture = name;
    for (const [of, made] of this.buttons) made.setAttribute('aria-pressed', String(of === name));
    setText(element('caption'), text.pictures[name][1]);
    this.remember();
  }

  // So that a reload, or somebody who is sent the address, sees the same.
  private remember(): void {
    const url = new URL(location.href);
    if (this.stream !== null) url.search = `?stream=${encodeURIComponent(this.stream)}`;
    url.hash = this.picture === 'camera' ? '' : this.picture;
    history.replaceState(null, '', url);
    element<HTMLAnchorElement>('viewer').href = `./${url.search}`;
  }

  private async run(): Promise<void> {
    for (;;) {
      const waitMs = document.hidden ? kAgainMs : await this.once();
      await new Promise((resolve) => window.setTimeout(resolve, waitMs));
    }
  }

  /** Milliseconds until the next. */
  private async once(): Promise<number> {
    try {
      const { underWay } = this.calibration;
      if (underWay !== null) return await this.watchCalibration(underWay);
      if (!(await this.findStream())) return kAgainMs;
      const [stream, picture] = [this.stream!, this.picture];
      const look = await lookAt(stream, picture);
      if (look === null) {
        this.say(text.state.waiting, 'waiting');
        return kEveryMs;
      }
      for (const card of this.cards) card.show(look);
      if (look.pictures.includes(picture)) this.draw(await pictureOf(stream, picture), picture);
      this.say(text.state.live(look.frame), 'live');
      return kEveryMs;
    } catch (error) {
      this.streams.dataset['listed'] = '';
      this.say(error instanceof Refused ? sentence(error.message) : text.state.lost, 'bad');
      return kAgainMs;
    }
  }

  private async watchCalibration(of: Calibration): Promise<number> {
    if (this.calibration.away) {
      this.say(text.state.lost, 'bad');
      return kAgainMs;
    }
    this.say(text.calibration.state(of.stream), 'live');
    if (of.state === 'pausing') return kEveryMs;
    this.draw(await calibrationPicture('camera'), 'calibration');
    await this.coverage.show(of);
    return kEveryMs;
  }

  private calibrationChanged(): void {
    const { underWay } = this.calibration;
    const on = underWay !== null;
    if (on && this.streams.value !== underWay.stream) {
      this.stream = underWay.stream; // that is what is seen now; it is not listed meanwhile
      this.streams.replaceChildren(make('option', { value: this.stream }, this.stream));
      this.remember();
    }
    document.body.classList.toggle('calibrating', on);
    setText(element('caption'), on ? text.calibration.caption : text.pictures[this.picture][1]);
    if (!on) this.coverage.hide();
    this.streams.disabled = on;
    if (!on) this.away = this.stream;
    this.streams.dataset['listed'] = ''; // the stream was away
  }

  /** Lists the streams at first and after a failure. */
  private async findStream(): Promise<boolean> {
    if (this.streams.dataset['listed'] === '1') return true;
    const names = await streamNames();
    if (this.calibration.underWay !== null) return false; // has begun meanwhile
    const away = this.away !== null && !names.includes(this.away);
    if (away) names.push(this.away!); // it comes back after its calibration
    this.streams.replaceChildren(...names.map((name) => make('option', { value: name }, name)));
    if (names.length === 0) {
      this.say(text.state.noStream, 'waiting');
      return false;
    }
    if (this.stream === null || !names.includes(this.stream)) this.stream = names[0]!;
    if (!away) this.away = null;
    this.streams.value = this.streams.title = this.stream;
    this.streams.dataset['listed'] = away ? '' : '1';
    this.remember();
    if (this.stream !== this.away) return true;
    this.say(text.state.waiting, 'waiting');
    return false;
  }

  private draw(bitmap: ImageBitmap | null, picture: PictureName | 'calibration'): void {
    if (bitmap === null) return; // that before stays
    draw(this.canvas, bitmap);
    this.canvas.dataset['shows'] = picture;
  }

  private say(what: string, state: 'live' | 'waiting' | 'bad'): void {
    const line = element('state');
    document.body.dataset['state'] = state;
    line.setAttribute('aria-live', state === 'live' ? 'off' : 'polite'); // not each frame's number
    setText(line, what);
  }
}

new RigPage();
