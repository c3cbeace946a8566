// SPDX-License-Identifier: Apache-2.0
// Streams that are shown beside the first one, in the same scene. Each has a decoder and a rate of its own.
import { LiveSource } from './liveSource';
import { openRemote } from './openFile';
import { rigPlace } from './placement';
import { writtenOf, type ListedStream, type Quality, type StreamInfo } from './protocol';
import { Session } from './session';
import type { Playback, SourceEvents } from './source';
import { isOver, present, type Presentation } from './state';
import { text } from './strings';
import type { Beside } from './surfaces';
import type { View } from './view';

interface Companion {
  session: Session;
  beside: Beside;
}

export class Companions {
  private readonly shown = new Map<string, Companion>();
  private readonly repeated = new WeakSet<Playback>();
  private quality: Quality | null = null;
  private wishedQuality = false;

  constructor(
    private readonly view: View,
    private readonly changed: () => void,
  ) {}

  get names(): string[] {
    return [...this.shown.keys()];
  }

  /** What the page would say of each if it were alone; those of which nothing comes any more are dimmed. */
  tell(): ReadonlyMap<string, Presentation> {
    const told = new Map<string, Presentation>();
    for (const [name, { session, beside }] of this.shown) {
      const now = present({ ...session.facts, problem: null, stream: name, hint: '' });
      this.view.dimBeside(beside, isOver(now) ? now.label : '');
      told.set(name, now);
    }
    return told;
  }

  /** Whether a frame of one that has come is on its way to the screen. */
  get isBusy(): boolean {
    return [...this.shown.values()].some(({ session }) => session.isBusy);
  }

  /** For tests and bug reports. */
  report(): object[] {
    return [...this.shown].map(([name, { session, beside }]) => {
      const { shown, errors, frame } = session.meter.report();
      const { index = null, following = null, times = null } = session.source?.playback ?? {};
      const pose = this.view.poseOf(name);
      return { name, word: beside.word, shown, errors, frame, busy: session.isBusy, pose, right: pose?.translation[0] ?? 0, extent: beside.extent, index, following, frames: times?.length ?? null };
    });
  }

  /** `listed`: what the server says of it, where it is known. `quietly`: its coming leaves the eye where it is. */
  add(name: string, listed: ListedStream | undefined, quietly = false): void {
    if (this.shown.has(name)) return;
    const session = new Session({
      changed: () => this.changed(),
      described: (info) => this.view.setRigPlace(name, rigPlace(info)),
      ready: () => this.view.invalidate(),
      hint: () => undefined,
      unusable: () => this.changed(),
    });
    this.shown.set(name, { session, beside: this.view.addBeside(name, quietly) });
    if (typeof listed?.recording === 'string') void this.openRecording(name, session, listed);
    else session.watch((events) => this.live(name, events));
    this.wish();
    this.changed();
  }

  /** What the server says of them now: what is played from a file that is being written goes on with what comes. */
  listed(find: (name: string) => ListedStream | undefined): void {
    for (const [name, { session }] of this.shown) {
      const { source } = session;
      if (source?.told === undefined) continue;
      const written = writtenOf(find(name));
      const playing = source.playback.playing;
      void source.told(written).then(() => {
        if (written === undefined && session.source === source) this.repeat(source.playback, playing);
      });
    }
  }

  /** What a time line of it drives. */
  playback(name: string): Playback | null {
    return this.shown.get(name)?.session.source?.playback ?? null;
  }

  info(name: string): StreamInfo | null {
    return this.shown.get(name)?.session.info ?? null;
  }

  remove(name: string): void {
    const companion = this.shown.get(name);
    if (companion === undefined) return;
    this.shown.delete(name);
    companion.session.end();
    this.view.removeBeside(companion.beside);
    this.changed();
  }

  /** On the screen's beat: what has come since. */
  draw(): void {
    for (const { session, beside } of this.shown.values()) {
      const first = !session.seen;
      const frame = session.take();
      if (frame === null) continue;
      this.view.showBeside(beside, frame);
      if (first) this.changed();
    }
  }

  /** How much detail is to come of all of them. */
  want(quality: Quality): void {
    this.quality = quality;
    for (const { session } of this.shown.values()) {
      if (session.source instanceof LiveSource) session.source.want(quality);
    }
  }

  /** What the decoders should bring along; `quality`: that of the vertices too, whatever the view needs. */
  wish(quality = this.wishedQuality): void {
    this.wishedQuality = quality;
    const { wants } = this.view;
    for (const { session } of this.shown.values()) session.decoder.want = { ...wants, quality: wants.quality || quality };
  }

  private live(name: string, events: SourceEvents): LiveSource {
    const source = new LiveSource(name, events);
    if (this.quality !== null) source.want(this.quality);
    return source;
  }

  // A file that is whole plays on and on beside the others, unless somebody has said otherwise since.
  private repeat(playback: Playback, playing: boolean): void {
    if (this.repeated.has(playback)) return;
    this.repeated.add(playback);
    playback.setLoop({ from: 0, to: playback.times[playback.times.length - 1]! });
    if (playing && !playback.playing) playback.play(); // it was at its end
  }

  private async openRecording(name: string, session: Session, listed: ListedStream): Promise<void> {
    const grows = writtenOf(listed) !== undefined;
    const opened = await openRemote(new URL(listed.recording!, document.baseURI)).catch(() => null);
    if (this.shown.get(name)?.session !== session) return;
    session.watch(opened === null ? (events) => this.live(name, events) : opened.source);
    if (opened !== null && !grows) this.repeat(session.source!.playback, false); // it plays by itself
  }
}

// Those that are gone, or never were there.
const isMissing = (told: Presentation): boolean => isOver(told) || told.state === 'waiting';

/** Its name, and a word where it is not there. */
export const called = (name: string, told: Presentation): string => text.streams.withWord(name, isMissing(told) ? told.label : '');

/** Which are not there, in words. */
export const besidesText = (besides: ReadonlyMap<string, Presentation>): string =>
  [...besides].flatMap(([name, told]) => (isMissing(told) ? [called(name, told)] : [])).join(', ');
