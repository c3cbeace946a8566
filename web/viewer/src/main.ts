// SPDX-License-Identifier: Apache-2.0
// The viewer: chooses a stream, feeds its frames to the picture, says how it goes, does what a person asks.
import { linkOf, sayShown, seeAs } from './addressBar';
import { loadDisplay, storeDisplay, type Display } from './display';
import { Choice } from './choice';
import { listenToCommands, toggleFullscreen } from './commands';
import { besidesText, called, Companions } from './companions';
import { DisplayPanel } from './displayPanel';
import { element } from './dom';
import { endHeld } from './early';
import { FilePicker } from './files';
import { fillHelp } from './helpPanel';
import { addImmersive, addStatistics, addTake, Measuring, Rest, Streams } from './laterParts';
import { Legend } from './legend';
import { LiveSource } from './liveSource';
import { firstOf, openFile, openRemote, recordingUrl, type Opened } from './openFile';
import { Panels } from './panels';
import { Pictures } from './pictures';
import type { DecodedFrame, Notice } from './messages';
import { rigPlace, type Placement } from './placement';
import { wantedQuality, writtenOf, type ListedStream, type Quality } from './protocol';
import { QualityControl, whyText, type Offered } from './qualityControl';
import { RecordControl } from './recordControl';
import { diagnosticsOf, report } from './reports';
import { namesOf, readShared, type Shared, type Shown } from './share';
import { Session } from './session';
import { present, type Presentation } from './state';
import { text } from './strings';
import { ServerList } from './streamList';
import { Timeline } from './timeline';
import { Ui } from './ui';
import { hasUnsaved } from './unsaved';
import { View } from './view';

const kRefreshMs = 250;

class Viewer {
  private readonly ui: Ui;
  readonly panels = new Panels((box) => this.ui.watch(box));
  private readonly legend = new Legend();
  private readonly pictures = new Pictures();
  private readonly displayPanel: DisplayPanel;
  private readonly qualityControl: QualityControl;
  private readonly measure: Measuring | null;
  private readonly rest: Rest;
  private readonly companions: Companions | null;
  private readonly streams: Streams;
  readonly timeline = new Timeline(
    element('timeline'),
    (name) => {
      this.timed = name;
      this.refresh();
    },
  );
  private timed: string | null = null; // a stream beside the first that the time line is of
  readonly record: RecordControl;
  private readonly session: Session;
  readonly view: View | null;
  display: Display;
  private quality: Quality | null = wantedQuality(location.search); // of live streams; null: nobody has chosen
  private shared: Shared | null; // by the link that was opened, until something else is chosen
  private pictureAlone = false; // what comes is no surface
  private posed = false; // the link's view is shown
  private problem: string | null = null;
  private readonly choice = new Choice();
  private chosenByPerson = false; // the stream, by the address or the picker
  private readonly server = new ServerList();
  private wantedBesides: string[] = []; // by the address, until the list says what they are
  private note = ''; // on the file shown
  private stream: string | null = null;
  private triedRecording = false; // of that stream
  private file: string | null = null; // shown instead of a stream
  private serverFile: string | null = null; // the same where it is one of the server's
  private presentation: Presentation | null = null;
  private notice: Notice | null = null; // of the frame that is shown

  constructor() {
    this.ui = new Ui({
      stream: (name) => this.choose(name),
      dismiss: () => {
        this.choice.dismiss();
        this.refresh();
      },
      insets: (parts, withPanel) => this.view?.navigator.setInsets(parts, withPanel),
      covers: (boxes) => this.view?.cover(boxes),
      retry: () => {
        this.session.source?.retryNow();
        this.server.retryNow();
      },
    });
    this.shared = readShared(location.hash, loadDisplay());
    this.display = this.shared.display;
    this.view = this.makeView();
    for (const [name, rigid] of this.shared.places) this.view?.place(name, rigid);
    document.documentElement.classList.toggle('software', this.view?.inSoftware === true);
    this.session = new Session({
      changed: () => this.refresh(),
      described: (info, seen) => {
        this.view?.restart(info.camera, seen);
        this.view?.setRigPlace(this.view.name, rigPlace(info));
      },
      ready: () => this.view?.invalidate(),
      hint: (hint) => (this.server.hint = hint),
      unusable: (message) => (this.problem = text.noDecoder(message)),
      signIn: () => void (hasUnsaved() || this.measure?.isOpen || location.reload()), // the page that the server answers with asks for a token
    });
    const picker = new FilePicker((files) => void this.showFile(firstOf(files).name, () => openFile(files)));
    this.panels.action('open', () => picker.ask());
    this.record = new RecordControl(this.panels.action('record', () => undefined));
    this.companions = this.view === null ? null : new Companions(this.view, () => this.refresh());
    this.streams = this.makeStreams();
    const displayBody = this.panels.panel('display', text.display.title);
    this.displayPanel = new DisplayPanel(displayBody, (part) => this.change(part));
    this.qualityControl = new QualityControl(displayBody, (quality) => this.chooseQuality(quality));
    if (this.quality !== null) this.companions?.want(this.quality);
    this.measure = this.makeMeasure();
    this.rest = new Rest(this.measure, () => this.view !== null && this.pictureComes);
    addStatistics(this.panels, {
      meter: this.session.meter,
      status: () => this.session.status,
      kept: () => this.session.source?.kept ?? null,
      quality: () => (this.offered === null ? null : whyText(this.offered)),
    });
    if (this.view !== null) {
      addTake(this.panels, {
        view: this.view,
        name: () => this.stream ?? this.file,
        link: () => this.link(),
        playback: () => this.session.source?.playback ?? null,
        info: () => this.session.info,
        filming: (video) => this.record.filming(video),
      });
      void addImmersive(this.view, (why) => {
        this.note = why;
        this.refresh();
      });
    }
    this.panels.action('reset', () => this.view?.navigator.reset());
    if (document.fullscreenEnabled) this.panels.action('fullscreen', toggleFullscreen);
    fillHelp(this.panels.panel('help', text.help.title));
    listenToCommands(this, this.ui.canvas);
    this.change({});
    this.openAddressed(this.shared);
    this.measure?.restore(this.shared.measured, namesOf(location.search));
    window.addEventListener('popstate', () => this.followAddress()); // not of what the page writes itself
    window.setInterval(() => this.refresh(), kRefreshMs);
    this.refresh();
  }

  /** True where that is shown already. */
  private openAddressed(shared: Shared): boolean {
    const [asked, ...besides] = namesOf(location.search);
    if (asked === undefined) return true;
    if (!new URLSearchParams(location.search).has('stream')) {
      if (asked === this.serverFile) return true;
      this.chosenByPerson = true;
      void this.openServerFile(asked, shared).then(() => (this.chosenByPerson = this.file !== null || this.stream !== null));
      return false;
    }
    this.chosenByPerson = true;
    for (const name of this.companions?.names ?? []) if (!besides.includes(name)) this.companions!.remove(name);
    this.wantedBesides = besides.filter((name) => name !== asked);
    if (asked === this.stream) return true;
    this.shared = shared;
    this.posed = false;
    this.watch(asked);
    return false;
  }

  /** A link to what is shown already, by a person's hand, or the browser's way back to what was shown before. */
  private followAddress(): void {
    this.choice.make();
    const shared = readShared(location.hash, this.display);
    for (const [name, rigid] of shared.places) this.view?.place(name, rigid);
    this.change(shared.display);
    if (this.openAddressed(shared)) seeAs((this.shared = shared), this.view, this.session.source);
    if (this.stream === namesOf(location.search)[0]) this.writeAddress(); // what detail is wanted may have been chosen since
    this.measure?.restore(shared.measured, namesOf(location.search));
    this.server.retryNow(); // says what is to be shown beside it
  }

  /** From now on; kept for the next visit. */
  change(part: Partial<Display>): void {
    this.display = { ...this.display, ...part };
    if (this.view !== null) this.view.display = this.display;
    this.wish();
    this.pictures.set(this.display.split, this.pictureAlone);
    storeDisplay(this.display);
    this.showDisplay();
  }

  diagnostics(): object {
    const { view, session, companions, measure, stream, file, problem } = this;
    return diagnosticsOf({ view, session, companions, measure, state: this.presentation?.state, stream, file, quality: this.offered, problem });
  }

  private makeView(): View | null {
    try {
      return new View(this.ui.canvas, element<HTMLCanvasElement>('overlay'), {
        beforeDraw: () => this.draw(),
        contextLost: (lost) => (this.problem = lost ? text.contextLost : null),
        failed: (why) => (this.problem = text.notDrawn(why)),
        way: (way) => this.change({ way }),
      });
    } catch {
      this.problem = text.noWebGl;
      return null;
    }
  }

  private makeMeasure(): Measuring | null {
    const { view } = this;
    if (view === null) return null;
    return new Measuring(this.panels, {
      view,
      pointed: (at) => this.pictures.point(at),
      described: (name) => (name === view.name ? this.session.info : (this.companions?.info(name) ?? null)),
      run: () => this.session.run,
      opened: (open) => {
        view.measuring = open;
        this.wish();
      },
    });
  }

  private makeStreams(): Streams {
    const events = {
      choose: (name: string) => this.choose(name),
      beside: (name: string, on: boolean) => {
        if (on) this.companions?.add(name, this.server.find(name));
        else this.companions?.remove(name);
        this.writeAddress();
      },
      recording: (file: string) => void this.openServerFile(file, null),
      placement: (placement: Placement) => {
        if (this.view !== null) this.view.placement = placement;
      },
    };
    return new Streams(this.panels, events, this.view, () => this.refresh());
  }

  /** To what is seen now. */
  link(): string {
    const { view, session, companions, measure, display, addressed } = this;
    return linkOf({ view, session, companions, measure, display, shown: addressed });
  }

  // What the decoder should bring along.
  private wish(): void {
    if (this.view === null) return;
    const { wants } = this.view;
    const measuring = this.measure?.isOpen === true;
    this.session.decoder.want = { ...wants, quality: wants.quality || measuring };
    this.companions?.wish(measuring);
  }

  private choose(name: string): void {
    const before = this.addressed;
    this.choice.make();
    this.chosenByPerson = true;
    this.shared = null;
    this.wantedBesides = [];
    for (const beside of this.companions?.names ?? []) this.companions!.remove(beside);
    this.watch(name);
    this.writeAddress(before);
  }

  /** What of the server is shown, as an address says it. */
  private get addressed(): Shown | null {
    if (this.stream === null) return this.serverFile === null ? null : { kind: 'recording', name: this.serverFile };
    const names = [this.stream, ...(this.companions?.names ?? []), ...this.wantedBesides];
    return { kind: 'stream', name: [...new Set(names)].join(','), quality: this.quality };
  }

  /** For this page's live streams, those that follow too. */
  private chooseQuality(quality: Quality): void {
    this.quality = quality;
    if (this.session.source instanceof LiveSource) this.session.source.want(quality);
    this.companions?.want(quality);
    this.writeAddress();
    this.refresh();
  }

  /** Null: what is shown is no live stream. */
  private get offered(): Offered | null {
    if (!(this.session.source instanceof LiveSource)) return null;
    const { rung: now, rungs: of, source } = this.session;
    return { want: this.quality, now, of, offline: !source.connected };
  }

  /** `before`: was shown until a person chose something else. */
  private writeAddress(before: Shown | null = null): void {
    sayShown(this.addressed, before, this.shared !== null);
  }

  private watch(name: string): void {
    if (name === this.stream) return;
    this.stream = name;
    this.file = this.serverFile = null;
    this.note = '';
    this.triedRecording = false;
    if (this.view !== null) this.view.name = name;
    this.session.watch((events) => {
      const source = new LiveSource(name, events);
      if (this.quality !== null) source.want(this.quality);
      this.record.watch({ stream: name, source, info: () => this.session.info });
      return source;
    });
    this.showTimeline();
    void this.preferRecording();
    this.refresh();
  }

  /** A stream that is played from a file is watched by the file, each page at its own place of it. */
  private async preferRecording(): Promise<void> {
    const listed = this.server.find(this.stream);
    if (this.triedRecording || listed === undefined) return;
    if (typeof listed.recording !== 'string') return this.findMoment(listed);
    this.triedRecording = true;
    try {
      const opened = await openRemote(new URL(listed.recording, document.baseURI));
      if (this.stream !== listed.name) return;
      this.view?.restart(null, false);
      this.posed = false; // the stream's own frames may have been shown meanwhile
      this.record.watch(null);
      this.session.watch((events) => opened.source(events, this.shared?.moment));
      this.note = opened.note ?? '';
      this.showTimeline();
    } catch (error) {
      this.session.meter.failed(error instanceof Error ? error.message : String(error)); // the stream goes on
    }
    this.refresh();
  }

  // A live stream is kept by the pages that watched it; the server has what it recorded.
  private async findMoment(listed: ListedStream): Promise<void> {
    const { shared } = this;
    if (shared === null || shared.moment === null) return;
    this.shared = { ...shared, moment: null };
    const found = await (await import('./recordedMoment')).recordedAt(listed, shared.moment);
    if (this.stream !== listed.name) return;
    if (found === null) this.note = text.momentGone;
    else await this.showFile(found.file, async () => found.opened, shared, found.file);
  }

  private openServerFile(name: string, shared: Shared | null): Promise<void> {
    return this.showFile(name, () => openRemote(recordingUrl(name)), shared, name);
  }

  /** `shared`: by the link that asks for it; null: a person has chosen it. `serverFile`: one of the server's. */
  private async showFile(name: string, open: () => Promise<Opened>, shared: Shared | null = null, serverFile: string | null = null): Promise<void> {
    const choice = this.choice.begin(name);
    this.refresh();
    try {
      const opened = await open();
      if (!this.choice.stillHolds(choice)) return;
      const before = shared === null ? this.addressed : null;
      this.chosenByPerson = true;
      this.stream = null;
      this.file = name;
      this.serverFile = serverFile;
      this.shared = shared;
      this.writeAddress(before);
      if (this.view !== null) this.view.name = name;
      this.choice.opened();
      this.view?.restart(null, false);
      this.posed = false;
      this.record.watch(null);
      this.session.watch(opened.kind === 'recording' ? (events) => opened.source(events, shared?.moment) : null);
      this.note = opened.note ?? '';
      if (opened.kind === 'surface') this.show(opened.frame);
    } catch (error) {
      if (!this.choice.stillHolds(choice)) return;
      this.choice.failed(name, error, this.session.seen);
    }
    this.refresh();
  }

  // Of the first stream, or of the one beside it that a person has chosen.
  private showTimeline(besides = this.companions?.tell() ?? new Map<string, Presentation>()): void {
    if (!besides.has(this.timed ?? '')) this.timed = null;
    const playback = this.session.source?.playback ?? null;
    this.timeline.show(this.timed === null ? playback : (this.companions?.playback(this.timed) ?? null));
    const first = this.stream ?? this.file ?? '';
    this.timeline.offer(new Map([[first, first], ...[...besides].map(([name, told]) => [name, called(name, told)] as const)]), this.timed);
  }

  // On the screen's beat.
  private draw(): void {
    const first = !this.session.seen;
    this.companions?.draw();
    const frame = this.view === null ? null : this.session.take();
    if (frame === null) return;
    this.show(frame);
    if (!first) return;
    performance.mark('first-picture');
    this.refresh();
  }

  private show(frame: DecodedFrame): void {
    if (this.view === null) return;
    this.view.show(frame);
    this.notice = frame.notice;
    this.showNotice();
    const first = !this.posed;
    const pose = first ? (this.shared?.pose ?? null) : null;
    this.posed = true;
    if (pose !== null && !this.view.navigator.isRigView) this.view.navigator.pose = pose;
    this.view.invalidate();
    this.pictureAlone = this.session.rung === 'texture' && frame.positions.length === 0 && frame.texture !== null;
    this.pictures.show(frame); // the one before is closed
    this.pictures.set(this.display.split, this.pictureAlone);
    this.wish();
    this.measure?.readCursor(first);
    this.rest.begin();
    this.showDisplay();
  }

  /** So far nothing says that none will. */
  private get pictureComes(): boolean {
    const { info, status } = this.session;
    if (info === null) return this.presentation?.state === 'connecting';
    return status === null || status.state === 'running';
  }

  /** The stream whose camera the server has, while what is shown is of now. */
  private get liveCamera(): string | null {
    const listed = this.session.source?.live === true ? this.server.find(this.stream) : undefined;
    return listed?.camera === true ? listed.name : null;
  }

  // What frames are like, else what the server says of the stream.
  private showNotice(): void {
    if (this.notice !== null) this.ui.showNotice(text.notices[this.notice], null);
    else this.ui.showNotice(this.presentation?.note ?? '', this.liveCamera);
  }

  private showDisplay(): void {
    this.legend.show(this.display.mode, this.view?.depthRange ?? null);
    this.displayPanel.show(this.display, this.view?.navigator.rigCamera !== null);
  }

  private refresh(): void {
    const { source, info, status, seen, facts } = this.session;
    const offline = source !== null && !source.connected; // it tries again by itself
    if (!offline || facts.refusal !== null) void this.list();
    const told = present({
      ...facts,
      ...(source === null ? { connected: this.server.arrived, retryInS: this.server.retryInS } : {}),
      problem: this.problem,
      stream: this.stream,
      opening: this.choice.opening,
      hint: this.server.hint,
      file: facts.file ?? (source === null && this.file !== null ? 'surface' : null),
    });
    this.presentation = this.choice.presented(told);
    this.ui.showState(this.presentation, seen, this.choice.hasFailed);
    this.showNotice();
    this.streams.panel?.show(this.server.streams, this.stream, this.companions?.names ?? [], this.server.whyUnknown(offline && facts.refusal === null));
    this.streams.panel?.showRecordings(this.server.streams, this.serverFile);
    const besides = this.companions?.tell() ?? new Map<string, Presentation>();
    this.ui.showStreams(this.server.streams, this.stream, this.file ?? info?.source ?? '', this.note || besidesText(besides));
    this.qualityControl.show(this.offered);
    this.pictures.watch(this.liveCamera);
    this.view?.refresh();
    this.showTimeline(besides);
    this.ui.showStatistics(seen ? this.session.meter.statistics(performance.now(), status) : []);
  }

  private async list(): Promise<void> {
    if (!(await this.server.refresh())) return;
    if (this.server.arrived) this.useList();
    else if (this.server.wantsToken && this.session.source === null && this.file === null) location.reload();
    this.refresh();
  }

  private useList(): void {
    const { streams } = this.server;
    this.session.everConnected = true;
    for (const { name, recorder } of streams) this.record.listed(name, recorder);
    if (this.serverFile !== null) {
      const writing = streams.find(({ recorder }) => recorder?.file === this.serverFile);
      void this.session.source?.told?.(writing?.recorder ?? undefined);
    } else if (this.stream !== null) {
      void this.session.source?.told?.(writtenOf(this.server.find(this.stream)));
    }
    const first = streams[0];
    const missing = this.session.info === null && this.server.find(this.stream) === undefined;
    if (first !== undefined && missing && !this.chosenByPerson) this.watch(first.name);
    void this.preferRecording();
    const eyeIsGiven = (this.shared?.pose ?? null) !== null; // by the link, which was made with them in sight
    for (const name of this.wantedBesides) this.companions?.add(name, this.server.find(name), eyeIsGiven);
    this.wantedBesides = [];
    this.companions?.listed((name) => this.server.find(name));
    endHeld();
  }
}

report(new Viewer());
