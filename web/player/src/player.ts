// SPDX-License-Identifier: Apache-2.0
// <relievo-player>: a stream or a recording in any page, with the viewer's own parts (relievo-player.d.ts is its API).
import { kDefaultDisplay, kModes, kThemes, type Mode, type Theme } from '../../viewer/src/display';
import { make, setText, windowOf } from '../../viewer/src/dom';
import { listenToKeys } from '../../viewer/src/keys';
import { LiveSource } from '../../viewer/src/liveSource';
import { NoAnswer } from '../../viewer/src/missing';
import { openRemote, type OpenedRecording } from '../../viewer/src/openFile';
import { wantedQuality } from '../../viewer/src/protocol';
import { NoGraphics } from '../../viewer/src/resolution';
import { sentence } from '../../viewer/src/sentence';
import { Session } from '../../viewer/src/session';
import { present } from '../../viewer/src/state';
import { ServerList } from '../../viewer/src/streamList';
import { text } from '../../viewer/src/strings';
import themeCss from '../../viewer/src/theme.css?inline';
import timelineCss from '../../viewer/src/timeline.css?inline';
import { Timeline } from '../../viewer/src/timeline';
import { View } from '../../viewer/src/view';
import type { PlayerState, RelievoPlayerElement } from '../relievo-player';
import { addressed, fileOf } from './address';
import playerCss from './player.css?inline';

const kRefreshMs = 250;
const kNear = '100px'; // of what is seen of the page: it is made ready there
const kFlags = ['controls', 'grid', 'loop'] as const;
const kSet = ['src', 'mode', 'theme', ...kFlags, 'currentTime', 'playbackRate'] as const; // properties of a page to set

const kStates: Record<ReturnType<typeof present>['state'], PlayerState> = {
  unsupported: 'failed',
  connecting: 'loading',
  lost: 'lost',
  refused: 'failed',
  empty: 'idle',
  waiting: 'loading',
  starting: 'loading',
  live: 'live',
  file: 'file',
  shifted: 'behind',
  stalled: 'stalled',
  ended: 'ended',
};

/** What there is while the element is in a page. */
interface Parts {
  view: View;
  session: Session;
  timeline: Timeline;
  page: Window; // the one that shows it
  timer: number;
}

/** What a page asks for, also before there is a frame to do it with. */
interface Wishes {
  playing?: boolean;
  time?: number; // seconds
  rate?: number;
}

/** A recording that a gateway is still writing. */
interface Written {
  readonly file: string;
  readonly recording: OpenedRecording;
  readonly server: ServerList;
}

/** As <video> has it: what is no number is a mistake of the page. */
function finite(value: number): number {
  if (!Number.isFinite(value)) throw new TypeError(`${value} is no finite number`);
  return value;
}

/** A page's colours, as an element's own: dark unless its theme says otherwise. */
const ofHost = (css: string): string =>
  css
    .replace(/:root:not\(\[data-theme=["']?dark["']?\]\)/g, ":host([theme='auto'])")
    .replace(/:root\[data-theme=["']?light["']?\]/g, ":host([theme='light'])")
    .replaceAll(':root', ':host');

export class RelievoPlayer extends HTMLElement implements RelievoPlayerElement {
  static readonly observedAttributes = ['src', 'mode', 'theme', ...kFlags];
  private readonly box = make('div', { className: 'box' });
  private readonly messageLine = make('p', { className: 'message', hidden: true });
  private readonly timelineBox = make('div', { id: 'timeline', hidden: true });
  private parts: Parts | null = null;
  private failure: string | null = null; // why src cannot be shown
  private stream: string | null = null;
  private written: Written | null = null;
  private notice = ''; // on the frame shown
  private opened = false; // what plays may be driven
  private wishes: Wishes = {}; // for when it is
  private contextLost = false;
  private inSight = true;
  private readonly sight = new IntersectionObserver(
    (changes) => {
      this.inSight = changes[changes.length - 1]!.isIntersecting;
      this.rouse();
    },
    { rootMargin: kNear },
  );
  private saidDuration = 0;
  private saidNews = '';
  private opening = 0; // counts what was opened, so that a late answer is known
  private state_: PlayerState = 'idle';
  private message_ = '';

  constructor() {
    super();
    const root = this.attachShadow({ mode: 'open' });
    this.dress(root);
    this.timelineBox.setAttribute('role', 'group');
    this.timelineBox.setAttribute('aria-label', text.timeline.slider);
    this.messageLine.setAttribute('role', 'status');
    root.append(this.box);
    listenToKeys(
      {
        mode: (mode) => (this.mode = mode),
        way: () => undefined,
        orbit: (right, up) => this.parts?.view.navigator.orbit(right, up),
        pan: (right, up) => this.parts?.view.navigator.pan(right, up),
        zoom: (factor) => this.parts?.view.navigator.zoom(factor),
        command: (key) => {
          if (key === 'r') this.resetView();
          return key === 'r' || this.parts?.timeline.command(key) === true;
        },
      },
      this.box,
    );
  }

  get src(): string {
    return this.getAttribute('src') ?? '';
  }
  set src(src: string) {
    this.setAttribute('src', src);
  }
  get theme(): Theme {
    return kThemes.find((theme) => theme === this.getAttribute('theme')) ?? 'dark';
  }
  set theme(theme: Theme) {
    this.setAttribute('theme', theme);
  }
  get mode(): Mode {
    return kModes.find((mode) => mode === this.getAttribute('mode')) ?? 'textured';
  }
  set mode(mode: Mode) {
    this.setAttribute('mode', mode);
  }
  get controls(): boolean {
    return this.hasAttribute('controls');
  }
  set controls(on: boolean) {
    this.toggleAttribute('controls', on);
  }
  get grid(): boolean {
    return this.hasAttribute('grid');
  }
  set grid(on: boolean) {
    this.toggleAttribute('grid', on);
  }
  get loop(): boolean {
    return this.hasAttribute('loop');
  }
  set loop(on: boolean) {
    this.toggleAttribute('loop', on);
  }
  get state(): PlayerState {
    return this.state_;
  }
  get message(): string {
    return this.message_;
  }
  get paused(): boolean {
    return !(this.wishes.playing ?? this.playback?.playing === true);
  }
  get currentTime(): number {
    const { driven } = this;
    return driven === null ? (this.wishes.time ?? 0) : (driven.position - driven.times[0]!) / 1000;
  }
  set currentTime(seconds: number) {
    this.wish({ time: finite(seconds) });
  }
  get duration(): number {
    const times = this.playback?.times;
    return times === undefined || times.length === 0 ? 0 : (times[times.length - 1]! - times[0]!) / 1000;
  }
  get playbackRate(): number {
    return this.wishes.rate ?? this.playback?.speed ?? 1;
  }
  set playbackRate(rate: number) {
    this.wish({ rate: finite(rate) });
  }

  play(): void {
    this.wish({ playing: true });
  }
  pause(): void {
    this.wish({ playing: false });
  }
  goLive(): void {
    this.wishes = {};
    this.playback?.follow();
    this.rouse();
  }
  resetView(): void {
    this.parts?.view.navigator.reset();
  }

  async screenshot(): Promise<Blob> {
    const view = this.parts?.view;
    if (view === undefined || view.shown === null) throw new Error(text.take.nothing);
    const blob = await view.png();
    if (blob === null) throw new Error(text.take.nothing);
    return blob;
  }

  connectedCallback(): void {
    if (this.parts !== null) return; // it was moved
    this.takeProperties();
    const canvas = make('canvas', { className: 'view', tabIndex: 0 });
    canvas.setAttribute('role', 'img');
    canvas.setAttribute('aria-label', text.player.canvas);
    const overlay = make('canvas', { className: 'overlay' });
    overlay.setAttribute('aria-hidden', 'true');
    this.box.replaceChildren(canvas, overlay, this.messageLine, this.timelineBox);
    try {
      const events = { beforeDraw: () => this.draw(), contextLost: (lost: boolean) => this.loseContext(lost), failed: (why: string) => this.fail(text.notDrawn(why)), way: () => undefined };
      const view = new View(canvas, overlay, events, this.box);
      const session = this.makeSession(view);
      this.timelineBox.replaceChildren();
      const timeline = new Timeline(this.timelineBox);
      const page = windowOf(this);
      this.parts = { view, session, timeline, page, timer: page.setInterval(() => this.refresh(), kRefreshMs) };
    } catch (error) {
      this.failure = error instanceof NoGraphics ? text.noWebGl : text.player.notStarted(error instanceof Error ? error.message : String(error));
      return this.refresh();
    }
    this.sight.observe(canvas);
    this.applyDisplay();
    void this.open();
  }

  disconnectedCallback(): void {
    // What a page moves from one place to another it takes out and puts back at once.
    queueMicrotask(() => {
      if (!this.isConnected) this.rest();
    });
  }

  adoptedCallback(): void {
    this.rest(); // another document draws at its own beat
    this.dress(this.shadowRoot!);
  }

  // Not by <style>, which a page's policy may forbid. Such sheets are of one document alone.
  private dress(root: ShadowRoot): void {
    const { CSSStyleSheet: Sheet } = windowOf(this);
    root.adoptedStyleSheets = [ofHost(themeCss), playerCss, timelineCss].map((css) => {
      const sheet = new Sheet();
      sheet.replaceSync(css);
      return sheet;
    });
  }

  attributeChangedCallback(name: string, before: string | null, now: string | null): void {
    if (name === 'src' && before !== now) this.wishes = {};
    if (this.parts === null) return;
    if (name === 'src') void this.open();
    else if (name === 'loop') this.applyLoop();
    else this.applyDisplay();
  }

  private rest(): void {
    const { parts } = this;
    this.parts = null;
    ++this.opening;
    if (parts === null) return;
    parts.page.clearInterval(parts.timer);
    this.sight.disconnect();
    this.inSight = true;
    parts.timeline.stop();
    parts.session.end();
    parts.view.end();
    this.contextLost = this.opened = false;
    this.refresh();
  }

  // Set before the browser knew what this element is, they would hide those of the class.
  private takeProperties(): void {
    for (const name of kSet) {
      if (!Object.hasOwn(this, name)) continue;
      const value = this[name];
      delete (this as Partial<Record<typeof name, unknown>>)[name];
      Object.assign(this, { [name]: value });
    }
  }

  private get playback() {
    return this.parts?.session.source?.playback ?? null;
  }

  /** What plays, once it has frames. */
  private get driven() {
    const { playback } = this;
    return this.opened && playback !== null && playback.times.length > 0 ? playback : null;
  }

  private wish(wishes: Wishes): void {
    this.wishes = { ...this.wishes, ...wishes };
    this.applyWishes();
  }

  private applyWishes(): void {
    const { driven } = this;
    if (driven === null) return this.rouse();
    const { rate, time, playing } = this.wishes;
    this.wishes = {};
    if (playing === false) driven.pause(); // first: it is at the time that was asked for then
    if (rate !== undefined) driven.setSpeed(rate);
    if (time !== undefined) driven.seek(driven.times[0]! + time * 1000);
    if (playing === true) driven.play();
    this.rouse();
  }

  /** Nobody sees it. Its first picture it gets all the same, as a <video> does. */
  private get isUnseen(): boolean {
    return (!this.inSight || this.ownerDocument.hidden) && this.parts?.session.seen === true;
  }

  /** What plays goes on without being drawn; what was asked for is drawn. */
  private get isIdle(): boolean {
    const { playback } = this;
    if (!this.isUnseen || playback?.playing !== true) return false;
    return playback.following === true || playback.loop !== null || playback.position < playback.times[playback.times.length - 1]!;
  }

  private rouse(): void {
    if (this.parts === null) return;
    const { session, view } = this.parts;
    session.rest(this.isUnseen);
    if (session.isBusy && !this.isIdle) view.invalidate();
  }

  private loseContext(lost: boolean): void {
    this.contextLost = lost;
    this.refresh();
  }

  private makeSession(view: View): Session {
    return new Session(
      {
        changed: () => this.refresh(),
        described: (info, seen) => view.restart(info.camera, seen),
        ready: () => this.isIdle || view.invalidate(),
        hint: () => undefined,
        unusable: (message) => this.fail(text.noDecoder(message)),
      },
      this.ownerDocument,
    );
  }

  private async open(): Promise<void> {
    const { session, view } = this.parts!;
    const opening = ++this.opening;
    this.failure = null;
    this.stream = null;
    this.written = null;
    this.notice = '';
    this.opened = false;
    session.watch(null);
    view.clear();
    view.restart(null, false);
    this.showTimeline();
    if (this.src === '') return this.refresh();
    try {
      const { url, stream } = addressed(this.src);
      if (stream === null) {
        const opened = await openRemote(url).catch((error: unknown) => {
          throw error instanceof NoAnswer ? new Error(text.player.noAnswer) : error; // the browser says no more
        });
        if (opening !== this.opening) return; // something else is to be shown meanwhile
        session.watch(opened.source);
        const file = fileOf(url);
        // A gateway's recordings are in a folder beside its list of streams.
        const list = new URL('..', url);
        list.search = url.search; // its token
        if (opened.isGrowing()) this.written = { file, recording: opened, server: new ServerList(list.href) };
        this.applyLoop();
        queueMicrotask(() => this.becomeOpened(opening)); // it has begun to play then
      } else {
        this.stream = stream;
        session.watch((events) => {
          const source = new LiveSource(stream, events, url.href);
          const quality = wantedQuality(url.search);
          if (quality !== null) source.want(quality);
          return source;
        });
        this.opened = true;
      }
    } catch (error) {
      if (opening === this.opening) this.fail(error instanceof Error ? error.message : String(error));
    }
    this.showTimeline();
    this.refresh();
  }

  private becomeOpened(opening: number): void {
    if (opening !== this.opening) return;
    this.opened = true;
    this.applyWishes();
  }

  private fail(why: string): void {
    this.failure = sentence(why);
    this.refresh();
  }

  private applyDisplay(): void {
    const { view, session } = this.parts!;
    view.display = { ...kDefaultDisplay, mode: this.mode, grid: this.grid };
    session.decoder.want = view.wants;
    this.showTimeline();
  }

  private applyLoop(): void {
    const { playback } = this;
    if (playback === null || playback.following !== null || this.written !== null) return;
    playback.setLoop(this.loop ? { from: 0, to: playback.times[playback.times.length - 1]! } : null);
  }

  private showTimeline(): void {
    this.parts?.timeline.show(this.controls ? this.playback : null);
  }

  // On the screen's beat.
  private draw(): void {
    if (this.parts === null || this.isIdle) return;
    const { session, view } = this.parts;
    const frame = session.take();
    if (frame === null) return;
    view.show(frame);
    this.notice = frame.notice === null ? '' : text.notices[frame.notice];
    view.invalidate();
    session.decoder.want = view.wants;
    const detail = { number: frame.number, vertices: frame.positions.length / 3, triangles: frame.triangles.length / 3 };
    this.dispatchEvent(new CustomEvent('frame', { detail }));
  }

  /** What is written on grows here, too, until it is whole. */
  private async follow(): Promise<void> {
    const { written } = this;
    if (written === null || this.isUnseen || !(await written.server.refresh()) || !written.server.arrived || written !== this.written) return;
    const writing = written.server.streams.find(({ recorder }) => recorder?.file === written.file);
    await this.parts?.session.source?.told?.(writing?.recorder ?? undefined);
    if (written !== this.written || written.recording.isGrowing()) return;
    this.written = null;
    this.applyLoop();
  }

  private refresh(): void {
    void this.follow();
    this.applyWishes();
    if (!this.isUnseen) this.parts?.view.refresh();
    const { duration } = this;
    if (duration !== this.saidDuration) {
      this.saidDuration = duration;
      this.dispatchEvent(new Event('durationchange'));
    }
    const { state, message } = this.judge();
    const retryInS = this.parts?.session.facts.retryInS ?? null;
    // Who listens is told of what is new, not of each second until the next attempt.
    const news = message.replace(text.states.again(retryInS), '');
    this.messageLine.setAttribute('aria-live', news === this.saidNews ? 'off' : 'polite');
    this.saidNews = news;
    setText(this.messageLine, message);
    this.messageLine.hidden = message === '';
    if (state === this.state_ && message === this.message_) return;
    this.state_ = state;
    this.message_ = message;
    this.dispatchEvent(new CustomEvent('statechange', { detail: { state, message } }));
  }

  private judge(): { state: PlayerState; message: string } {
    if (this.failure !== null) return { state: 'failed', message: this.failure };
    const session = this.parts?.session;
    if (!session || this.src === '') return { state: 'idle', message: '' };
    if (this.contextLost) return { state: 'failed', message: text.contextLost };
    if (session.source === null) return { state: 'loading', message: '' };
    const told = present({ ...session.facts, problem: null, stream: this.stream, hint: '' });
    const { connected, everConnected, retryInS, refusal } = session.facts;
    // What the viewer says then is of its own page.
    if (refusal === 'name') return { state: 'failed', message: text.player.noName };
    if (!connected && !everConnected && retryInS !== null && refusal === null)
      return { state: 'lost', message: `${text.player.noAnswer} ${text.states.again(retryInS)}` };
    return { state: kStates[told.state], message: told.title === '' ? this.notice : `${told.title}. ${told.text}` };
  }
}
