// SPDX-License-Identifier: Apache-2.0
// The viewer: chooses a stream, feeds its frames through the decoder to the picture, says how it goes.
import { Connection, utcNow } from './connection';
import { Decoder } from './decoder';
import { Meter } from './meter';
import type { Mode } from './mesh';
import type { DecodedFrame } from './messages';
import type { FramePrefix, ListedStream, ServerMessage, StreamInfo, StreamList, StreamStatus } from './protocol';
import { present, type Presentation } from './state';
import { Ui } from './ui';
import { View, type PixelReport } from './view';

const kListEveryMs = 2000;
const kRefreshMs = 250;

class Viewer {
  private readonly ui: Ui;
  private view: View | null = null;
  private readonly decoder: Decoder;
  private readonly meter = new Meter();
  private connection: Connection | null = null;

  private problem: string | null = null;
  private everConnected = false;
  private listed = false; // the last list arrived
  private listFailed = false;
  private nextListAt = 0;
  private chosenByPerson = false; // the stream, by the address or the picker
  private streams: ListedStream[] = [];
  private hint = '';
  private stream: string | null = null;
  private info: StreamInfo | null = null; // of the stream while it is announced
  private status: StreamStatus | null = null;
  private seen = false;
  private lastFrameAt = 0;
  private readonly underway = new Map<number, FramePrefix>(); // in the decoder
  private ready: { frame: DecodedFrame; prefix: FramePrefix } | null = null; // decoded, not drawn
  private presentation: Presentation | null = null;

  constructor() {
    this.ui = new Ui({
      mode: (mode) => this.setMode(mode),
      stream: (name) => this.choose(name),
      reset: () => this.view?.reset(),
      retry: () => {
        this.connection?.retryNow();
        this.nextListAt = 0;
      },
      orbit: (right, up) => this.view?.orbit(right, up),
      pan: (right, up) => this.view?.pan(right, up),
      zoom: (factor) => this.view?.zoom(factor),
    });
    try {
      this.view = new View(this.ui.canvas, {
        beforeDraw: () => this.draw(),
        contextLost: (lost) => {
          this.problem = lost ? 'The graphics driver took the picture away. It should come back by itself.' : null;
        },
      });
    } catch {
      this.problem =
        'This browser or its graphics driver has no WebGL 2. Try another browser, or turn on hardware acceleration.';
    }
    this.decoder = new Decoder({
      decoded: (frame) => this.onDecoded(frame),
      failed: (id, message) => this.onFailed(id, message),
      unusable: (message) => (this.problem = `The decoder does not start: ${message}.`),
    });
    this.ui.showMode('textured');
    document.addEventListener('visibilitychange', () => this.meter.pause());
    const asked = new URLSearchParams(location.search).get('stream');
    if (asked !== null && asked !== '') {
      this.chosenByPerson = true;
      this.watch(asked);
    }
    window.setInterval(() => this.refresh(), kRefreshMs);
    this.refresh();
  }

  setMode(mode: Mode): void {
    if (this.view === null) return;
    this.view.mode = mode;
    this.decoder.want = this.view.wants;
    this.ui.showMode(mode);
  }

  diagnostics(): object {
    return {
      state: this.presentation?.state,
      stream: this.stream,
      mode: this.view?.mode,
      drawn: this.view?.drawn,
      scale: this.view?.movingScale,
      problem: this.problem,
      ...this.meter.report(),
    };
  }

  readPixels(): PixelReport | null {
    return this.view?.readPixels() ?? null;
  }

  private choose(name: string): void {
    this.chosenByPerson = true;
    const url = new URL(location.href);
    url.searchParams.set('stream', name);
    history.replaceState(null, '', url);
    this.watch(name);
  }

  private watch(name: string): void {
    if (name === this.stream) return;
    this.connection?.stop();
    this.underway.clear();
    this.discard();
    this.stream = name;
    this.info = this.status = null;
    this.seen = false;
    this.meter.restart();
    this.connection = new Connection(name, {
      open: () => {
        this.everConnected = true;
        this.underway.clear(); // their credit went with the old connection
        this.discard();
        this.meter.restart();
        this.refresh();
      },
      lost: () => {
        this.info = this.status = null;
        this.refresh();
      },
      message: (message) => this.onMessage(message),
      frame: (prefix, bytes) => this.onFrame(prefix, bytes),
      clock: (t0, serverMs, t1) => this.meter.clock.add(t0, serverMs, t1),
      nonsense: (message) => this.meter.failed(message),
    });
    this.refresh();
  }

  private onMessage(message: ServerMessage): void {
    if (message.type === 'info') {
      if (this.info === null) this.meter.restart();
      this.info = message;
      this.view?.restart(message.camera, this.seen);
      this.lastFrameAt = performance.now();
    } else if (message.type === 'status') {
      this.status = message;
    } else if (message.type === 'waiting' || message.type === 'gone') {
      this.info = this.status = null;
      if (message.type === 'waiting') this.hint = message.hint;
    }
    this.refresh();
  }

  private onFrame(prefix: FramePrefix, bytes: ArrayBuffer): void {
    this.lastFrameAt = performance.now();
    this.meter.arrived(prefix, bytes.byteLength, this.lastFrameAt);
    this.underway.set(this.decoder.decode(bytes, prefix.bytes), prefix);
  }

  private onDecoded(frame: DecodedFrame): void {
    const prefix = this.underway.get(frame.id);
    if (!this.underway.delete(frame.id) || prefix === undefined || this.view === null) {
      frame.texture?.close(); // of a stream that is no longer watched
      return;
    }
    if (this.discard()) {
      ++this.meter.skipped;
      this.connection?.credit();
    }
    this.ready = { frame, prefix };
    this.view.invalidate();
  }

  private onFailed(id: number, message: string): void {
    this.meter.failed(message);
    if (this.underway.delete(id)) this.connection?.credit();
  }

  // On the screen's beat. Credit goes back only now, so a hidden page receives nothing.
  private draw(): void {
    if (this.ready === null || this.view === null) return;
    const { frame, prefix } = this.ready;
    this.ready = null;
    this.view.show(frame);
    this.ui.showNotice(frame.notice);
    this.decoder.want = this.view.wants;
    this.meter.shown(frame, prefix, utcNow(), performance.now());
    this.connection?.credit();
    if (!this.seen) {
      this.seen = true;
      this.refresh();
    }
  }

  private discard(): boolean {
    const had = this.ready !== null;
    this.ready?.frame.texture?.close();
    this.ready = null;
    return had;
  }

  private refresh(): void {
    const now = performance.now();
    const connection = this.connection;
    const offline = connection !== null && !connection.connected; // it tries again by itself
    if (now >= this.nextListAt && !document.hidden && !offline) {
      this.nextListAt = now + kListEveryMs;
      void this.list();
    }
    const listRetryInS = this.listFailed ? Math.ceil(Math.max(0, this.nextListAt - now) / 1000) : null;
    this.presentation = present({
      problem: this.problem,
      everConnected: this.everConnected,
      connected: connection === null ? this.listed : connection.connected,
      retryInS: connection === null ? listRetryInS : connection.retryInS,
      stream: this.stream,
      announced: this.info !== null,
      seen: this.seen,
      serverState: this.status?.state ?? null,
      serverMessage: this.status?.message ?? '',
      quietMs: now - this.lastFrameAt,
      frameRate: this.info?.frame_rate ?? 0,
      hint: this.hint,
    });
    this.ui.showState(this.presentation, this.seen);
    this.ui.showStreams(this.streams, this.stream, this.info?.source ?? '');
    this.ui.showStatistics(this.seen ? this.meter.statistics(now, this.status) : []);
  }

  private async list(): Promise<void> {
    try {
      const response = await fetch(new URL('api/streams', document.baseURI), {
        cache: 'no-store',
        signal: AbortSignal.timeout(5000),
      });
      if (!response.ok) throw new Error(`HTTP ${response.status}`);
      const list = (await response.json()) as StreamList;
      this.listed = true;
      this.listFailed = false;
      this.everConnected = true;
      this.streams = list.streams;
      this.hint = list.hint;
      const first = list.streams[0];
      const missing = this.info === null && !list.streams.some((s) => s.name === this.stream);
      if (first !== undefined && missing && !this.chosenByPerson) this.watch(first.name);
    } catch {
      this.listed = false;
      this.listFailed = true;
    }
    this.refresh();
  }
}

declare global {
  interface Window {
    /** For tests and bug reports; not a stable interface. */
    relievo: { diagnostics(): object; readPixels(): PixelReport | null; setMode(mode: Mode): void };
  }
}

const viewer = new Viewer();
window.relievo = {
  diagnostics: () => viewer.diagnostics(),
  readPixels: () => viewer.readPixels(),
  setMode: (mode) => viewer.setMode(mode),
};
