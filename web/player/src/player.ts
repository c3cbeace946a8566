// SPDX-License-Identifier: Apache-2.0
// <relievo-player>: a stream or a recording in any page, with the viewer's own parts (relievo-player.d.ts is its API).
import { kDefaultDisplay, kModes, kThemes, type Mode, type Theme } from '../../viewer/src/display';
import { make } from '../../viewer/src/dom';
import { listenToKeys } from '../../viewer/src/keys';
import { LiveSource } from '../../viewer/src/liveSource';
import { openRemote, type OpenedRecording } from '../../viewer/src/openFile';
import { Session } from '../../viewer/src/session';
import { present } from '../../viewer/src/state';
import { ServerList } from '../../viewer/src/streamList';
import { text } from '../../viewer/src/strings';
import themeCss from '../../viewer/src/theme.css?inline';
import timelineCss from '../../viewer/src/timeline.css?inline';
import { Timeline } from '../../viewer/src/timeline';
import { View } from '../../viewer/src/view';
import type { PlayerState, RelievoPlayerElement } from '../relievo-player';
import playerCss from './player.css?inline';

const kRefreshMs = 250;
const kFlags = ['controls', 'grid', 'loop'] as const;

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
  timer: number;
}

/** A recording that a gateway is still writing. */
interface Written {
  readonly file: string;
  readonly recording: OpenedRecording;
  readonly server: ServerList;
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
  private saidDuration = 0;
  private opening = 0; // counts what was opened, so that a late answer is known
  private state_: PlayerState = 'idle';
  private message_ = '';

  constructor() {
    super();
    const root = this.attachShadow({ mode: 'open' });
    // Not <style>, which a page's policy may forbid.
    root.adoptedStyleSheets = [ofHost(themeCss), playerCss, timelineCss].map((css) => {
      const sheet = new CSSStyleSheet();
      sheet.replaceSync(css);
      return sheet;
    });
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
    return this.playback?.playing !== true;
  }
  get currentTime(): number {
    const { playback } = this;
    return playback === null || playback.times.length === 0 ? 0 : (playback.position - playback.times[0]!) / 1000;
  }
  set currentTime(seconds: number) {
    const { playback } = this;
    if (playback !== null && playback.times.length > 0) playback.seek(playback.times[0]! + seconds * 1000);
  }
  get duration(): number {
    const times = this.playback?.times;
    return times === undefined || times.length === 0 ? 0 : (times[times.length - 1]! - times[0]!) / 1000;
  }
  get playbackRate(): number {
    return this.playback?.speed ?? 1;
  }
  set playbackRate(rate: number) {
    this.playback?.setSpeed(rate);
  }

  play(): void {
    this.playback?.play();
  }
  pause(): void {
    this.playback?.pause();
  }
  goLive(): void {
    this.playback?.follow();
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
    const canvas = make('canvas', { className: 'view', tabIndex: 0 });
    canvas.setAttribute('role', 'img');
    canvas.setAttribute('aria-label', text.player.canvas);
    const overlay = make('canvas', { className: 'overlay' });
    overlay.setAttribute('aria-hidden', 'true');
    this.box.replaceChildren(canvas, overlay, this.messageLine, this.timelineBox);
    try {
      const events = { beforeDraw: () => this.draw(), contextLost: () => undefined, failed: (why: string) => this.fail(text.notDrawn(why)), way: () => undefined };
      const view = new View(canvas, overlay, events, this.box);
      const session = this.makeSession(view);
      this.timelineBox.replaceChildren();
      const timeline = new Timeline(this.timelineBox);
      this.parts = { view, session, timeline, timer: window.setInterval(() => this.refresh(), kRefreshMs) };
    } catch {
      this.failure = text.noWebGl;
      return this.refresh();
    }
    this.applyDisplay();
    void this.open();
  }

  disconnectedCallback(): void {
    const { parts } = this;
    this.parts = null;
    ++this.opening;
    if (parts === null) return;
    window.clearInterval(parts.timer);
    parts.timeline.stop();
    parts.session.end();
    parts.view.end();
  }

  attributeChangedCallback(name: string): void {
    if (this.parts === null) return;
    if (name === 'src') void this.open();
    else if (name === 'loop') this.applyLoop();
    else this.applyDisplay();
  }

  private get playback() {
    return this.parts?.session.source?.playback ?? null;
  }

  private makeSession(view: View): Session {
    return new Session({
      changed: () => this.refresh(),
      described: (info, seen) => view.restart(info.camera, seen),
      ready: () => view.invalidate(),
      hint: () => undefined,
      unusable: (message) => this.fail(text.noDecoder(message)),
    });
  }

  private async open(): Promise<void> {
    const { session, view } = this.parts!;
    const opening = ++this.opening;
    this.failure = null;
    this.stream = null;
    this.written = null;
    this.notice = '';
    session.watch(null);
    view.restart(null, false);
    this.showTimeline();
    if (this.src === '') return this.refresh();
    try {
      const url = new URL(this.src, document.baseURI);
      if (/\.mcap$/i.test(url.pathname)) {
        const opened = await openRemote(url);
        if (opening !== this.opening) return; // something else is to be shown meanwhile
        session.watch(opened.source);
        const file = decodeURIComponent(url.pathname.slice(url.pathname.lastIndexOf('/') + 1));
        // A gateway's recordings are in a folder beside its list of streams.
        if (opened.isGrowing()) this.written = { file, recording: opened, server: new ServerList(new URL('..', url).href) };
        this.applyLoop();
      } else {
        const stream = url.searchParams.get('stream') ?? '';
        if (stream === '') throw new Error(text.player.noStream);
        url.search = url.hash = '';
        this.stream = stream;
        session.watch((events) => new LiveSource(stream, events, url.href));
      }
    } catch (error) {
      if (opening === this.opening) this.fail(error instanceof Error ? error.message : String(error));
    }
    this.showTimeline();
    this.refresh();
  }

  private fail(why: string): void {
    this.failure = why;
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
    if (this.parts === null) return;
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
    if (written === null || !(await written.server.refresh()) || !written.server.arrived || written !== this.written) return;
    const writing = written.server.streams.find(({ recorder }) => recorder?.file === written.file);
    await this.parts?.session.source?.told?.(writing?.recorder ?? undefined);
    if (written !== this.written || written.recording.isGrowing()) return;
    this.written = null;
    this.applyLoop();
  }

  private refresh(): void {
    void this.follow();
    const { duration } = this;
    if (duration !== this.saidDuration) {
      this.saidDuration = duration;
      this.dispatchEvent(new Event('durationchange'));
    }
    const { state, message } = this.judge();
    this.messageLine.textContent = message;
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
    if (session.source === null) return { state: 'loading', message: '' };
    const told = present({ ...session.facts, problem: null, stream: this.stream, hint: '' });
    return { state: kStates[told.state], message: told.title === '' ? this.notice : `${told.title}. ${told.text}` };
  }
}
