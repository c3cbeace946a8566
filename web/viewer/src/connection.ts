// SPDX-License-Identifier: Apache-2.0
// One WebSocket to one stream, kept up: clock exchange, silence as loss, retries with backoff.
import { openSocket, socketUrl, streamUrl, take } from './early';
import { parseFramePrefix, parseServerMessage, type Quality } from './protocol';
import type { SourceEvents } from './source';
import { backoffS, type Refusal } from './state';
import { VideoTextures } from './videoTexture';

const kClockEveryMs = 4000;
const kClockSoonMs = 500; // at first, since a page that is being built up answers late and lopsided, and where the gateway does not know yet
const kClocksSoon = 6;
const kSilenceMs = 12_000; // the clock exchange alone brings a message every 4 s
const kLongestMs = 30_000; // as the server has: a large frame on a slow line holds up its answers, and tells of itself once it is whole

export const utcNow = (): number => performance.timeOrigin + performance.now();

const kRefusals: Record<number, Refusal> = { 400: 'name', 401: 'token', 503: 'places' };

/** A WebSocket that is refused does not say why; who asks for the same without one is told. */
async function refusalOf(stream: string, server: string): Promise<Refusal | null> {
  const credentials = server === document.baseURI ? 'same-origin' : 'include'; // as with a WebSocket
  const response = await fetch(streamUrl(stream, server), { cache: 'no-store', credentials }).catch(() => null);
  return kRefusals[response?.status ?? 0] ?? null;
}

export class Connection {
  refusal: Refusal | null = null; // of the last attempt, once the server has said it
  private socket: WebSocket | null = null;
  private attempt = 0;
  private retryAt: number | null = null; // performance.now()
  private lastHeard = 0;
  private patienceMs = kSilenceMs; // longer where messages took as long, or a silence may have been such a message
  private lastClock = -Infinity;
  private clocks = 0; // compared since the socket opened
  private stopped = false;
  private readonly timer: number;
  private wanted: Quality | null = null;

  /** `server`: the address of its page. */
  constructor(
    private readonly stream: string,
    private readonly events: SourceEvents,
    private readonly server: string = document.baseURI,
  ) {
    this.connect();
    if (VideoTextures.possible)
      void VideoTextures.probed.then(() => {
        if (!VideoTextures.possible) this.sayWhatIsWanted();
      });
    this.timer = this.timers.setInterval(() => this.tick(), 250);
  }

  get connected(): boolean {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  /** Whole seconds until the next attempt; null while connected or connecting for the first time. */
  get retryInS(): number | null {
    if (this.retryAt === null) return this.attempt > 0 && !this.connected ? 0 : null;
    return Math.max(0, Math.ceil((this.retryAt - performance.now()) / 1000));
  }

  /** This many frames more may come; none may where it has just opened. */
  credit(n = 1): void {
    this.send({ type: 'credit', n });
  }

  /** How much detail is wanted from now on, and after each loss of the connection. */
  want(quality: Quality): void {
    this.wanted = quality;
    this.sayWhatIsWanted();
  }

  private sayWhatIsWanted(): void {
    if (this.wanted === null && VideoTextures.possible) return; // what a server sends by itself
    const textures = VideoTextures.possible ? {} : { textures: ['jpeg', 'webp', 'png'] };
    this.send({ type: 'quality', want: this.wanted ?? 'full', ...textures });
  }

  retryNow(): void {
    if (this.retryAt !== null) this.connect();
  }

  stop(): void {
    this.stopped = true;
    this.timers.clearInterval(this.timer);
    this.detach(1000);
  }

  private get timers(): Window {
    return this.events.timers ?? window;
  }

  private connect(): void {
    this.detach();
    this.retryAt = null;
    const url = socketUrl(this.stream, this.server);
    const socket = take<WebSocket>(url) ?? openSocket(url);
    this.socket = socket;
    this.lastHeard = performance.now();
    socket.onopen = () => {
      this.attempt = 0;
      this.refusal = null;
      this.lastHeard = performance.now();
      this.lastClock = -Infinity;
      this.clocks = 0;
      this.sayWhatIsWanted();
      this.events.open();
      this.tick();
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => this.receive(event.data);
    socket.onclose = () => this.onLost();
  }

  private receive(data: string | ArrayBuffer): void {
    this.waitFor(performance.now() - this.lastHeard);
    this.lastHeard = performance.now();
    try {
      if (typeof data !== 'string') {
        this.events.frame(parseFramePrefix(data), data, false);
        return;
      }
      const message = parseServerMessage(data);
      if (message?.type === 'time') this.compareClocks(message.t0, message.server_ms);
      else if (message !== null) this.events.message(message);
    } catch (error) {
      if (typeof data !== 'string') this.credit();
      this.events.nonsense(error instanceof Error ? error.message : String(error));
    }
  }

  private waitFor(silenceMs: number): void {
    this.patienceMs = Math.min(Math.max(this.patienceMs, 2 * silenceMs), kLongestMs);
  }

  private compareClocks(t0: number, serverMs: number | null): void {
    if (serverMs === null) return;
    ++this.clocks;
    this.events.clock(t0, serverMs, utcNow());
  }

  private onLost(): void {
    this.detach();
    if (this.stopped) return;
    this.retryAt = performance.now() + backoffS(this.attempt++) * 1000;
    this.events.lost();
    void this.askWhy();
  }

  private async askWhy(): Promise<void> {
    const refusal = await refusalOf(this.stream, this.server);
    if (this.connected || this.stopped) return;
    this.refusal = refusal;
    if (refusal === 'token') this.events.signIn?.();
  }

  private tick(): void {
    const now = performance.now();
    if (this.retryAt !== null) {
      if (now >= this.retryAt) this.connect();
      return;
    }
    if (now - this.lastHeard > (this.connected ? this.patienceMs : kSilenceMs)) {
      if (this.connected) this.waitFor(this.patienceMs);
      return this.onLost();
    }
    if (this.connected && now - this.lastClock > (this.clocks < kClocksSoon ? kClockSoonMs : kClockEveryMs)) {
      this.lastClock = now;
      this.send({ type: 'time', t0: utcNow() });
    }
  }

  private send(message: object): void {
    if (this.connected) this.socket?.send(JSON.stringify(message));
  }

  private detach(code?: number): void {
    const socket = this.socket;
    this.socket = null;
    if (socket === null) return;
    socket.onopen = socket.onmessage = socket.onclose = null;
    socket.close(code);
  }
}
