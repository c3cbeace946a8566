// SPDX-License-Identifier: Apache-2.0
// A live stream as a source of frames. What comes is kept for a while, so that a person can stop it, go back, and
// return to what is live. Kept frames are played as those of a recording are.
import { Connection } from './connection';
import { Credit } from './credit';
import type { FrameStore } from './frameStore';
import { History } from './history';
import { frameAt, type Loop } from './playback';
import type { FramePrefix, Quality } from './protocol';
import type { FrameSource, Kept, Playback, SourceEvents } from './source';
import type { Refusal } from './state';
import { StorePlayer } from './storePlayer';

const kBegun = 1; // runs of a player that is where the live stream was stopped

export class LiveSource implements FrameSource, Playback {
  readonly playback: Playback = this;
  private readonly history: History;
  private readonly connection: Connection;
  private player: StorePlayer | null = null; // of what was; null: what comes is shown
  private returning = false; // the player catches up
  private runs = 0; // before the one that is live, or that the player began with
  private readonly underWay = new Credit();
  private withServer = 0; // frames that the server may send
  private resting = false; // nothing more is asked for
  private withPage = 0; // frames that the page has not shown yet
  changed: () => void = () => undefined;
  /** Gets each message that comes from now on, to be read only. */
  tap: ((message: ArrayBuffer) => void) | null = null;

  /** `server`: the address of its page, where it is not this one. */
  constructor(
    stream: string,
    private readonly events: SourceEvents,
    server?: string,
  ) {
    const received: SourceEvents = {
      ...events,
      open: () => this.onOpen(),
      lost: () => {
        if (this.live) events.lost(); // what was is still there to be seen
      },
      message: (message) => {
        if (message.type === 'info') {
          this.history.info = message;
          this.underWay.frameRate = message.frame_rate;
        }
        events.message(message);
      },
      frame: (prefix, message) => this.onFrame(prefix, message),
      clock: (t0, serverMs, t1) => {
        this.underWay.wentRound(t1 - t0);
        events.clock(t0, serverMs, t1);
      },
    };
    this.history = new History(undefined, stream);
    this.history.going = (index) => this.holdRange(index);
    this.connection = new Connection(stream, received, server);
  }

  get connected(): boolean {
    return this.connection.connected;
  }
  get retryInS(): number | null {
    return this.connection.retryInS;
  }
  get refusal(): Refusal | null {
    return this.connection.refusal;
  }
  get live(): boolean {
    return this.player === null;
  }
  get kept(): Kept {
    return this.history;
  }
  get store(): FrameStore {
    return this.player?.store ?? this.history;
  }
  get following(): boolean {
    return this.live || this.returning;
  }
  get times(): Float64Array {
    return this.store.times;
  }
  get startMs(): number {
    return this.store.startMs;
  }
  get first(): number {
    return this.store.first;
  }
  get newestMs(): number {
    const { times, startMs } = this.history;
    return startMs + (times[times.length - 1] ?? 0);
  }
  get index(): number {
    return this.player?.index ?? Math.max(this.first, this.history.end - 1);
  }
  get run(): number {
    return this.runs + (this.player === null ? 0 : Math.max(0, this.player.run - kBegun));
  }
  get position(): number {
    return this.player?.position ?? this.times[this.times.length - 1] ?? 0;
  }
  get playing(): boolean {
    return this.player?.playing ?? true;
  }
  get speed(): number {
    return this.player?.speed ?? 1;
  }
  get loop(): Loop | null {
    return this.player?.loop ?? null;
  }
  isKey(index: number): boolean | null {
    return this.store.isKey(index);
  }
  gapBefore(index: number): number {
    return this.store.gapBefore(index);
  }

  /** Oldest first; to be read only. */
  keptMessages(): ArrayBuffer[] {
    return this.history.messages;
  }

  play(): void {
    this.player?.play();
  }
  pause(): void {
    this.shifted()?.pause();
  }
  seek(atMs: number): void {
    this.shifted()?.seek(atMs);
  }
  step(frames: number): void {
    this.shifted()?.step(frames);
  }
  setSpeed(speed: number): void {
    if (speed !== 1 || !this.live) this.shifted(true)?.setSpeed(speed);
  }
  setLoop(loop: Loop | null): void {
    if (loop === null && this.live) return;
    const player = this.shifted(true);
    if (loop === null && player !== null) player.store = this.history;
    player?.setLoop(loop);
  }

  /** The page goes on when it has what the next frame builds on. */
  follow(): void {
    const { player } = this;
    if (player === null) return;
    this.returning = true;
    player.pause();
    player.setLoop(null);
    player.store = this.history;
    player.seek(Infinity);
  }

  /** The page has shown this many frames, or skipped them, whoever sent them. */
  credit(n = 1, shown = true): void {
    this.withPage = Math.max(0, this.withPage - n);
    this.player?.credit(n);
    const slow = this.underWay.frames === 1;
    if (!shown) this.underWay.skipped();
    else if (this.live) this.underWay.shown(performance.now(), this.withPage);
    // Asked for before the drawing that has just begun, it would wait for that to end.
    if (slow) (this.events.timers ?? window).setTimeout(() => this.topUp());
    else this.topUp();
  }

  /** How much detail is to come. */
  want(quality: Quality): void {
    this.connection.want(quality);
  }

  rest(resting: boolean): void {
    this.resting = resting;
    this.topUp();
  }

  retryNow(): void {
    this.connection.retryNow();
  }

  stop(): void {
    this.player?.stop();
    this.connection.stop();
  }

  // The player of what was, from the newest frame on; null where nothing is kept yet.
  private shifted(playing = false): StorePlayer | null {
    this.returning = false;
    if (this.player !== null || this.times.length === 0) return this.player;
    const events = {
      frame: (prefix: FramePrefix, message: ArrayBuffer, forLater: boolean): void => {
        if (!forLater) ++this.withPage;
        this.events.frame(prefix, message, forLater);
      },
      nonsense: (message: string): void => this.events.nonsense(message),
      timers: this.events.timers,
      sent: (index: number): void => {
        if (this.returning && index === this.history.end - 1) this.becomeLive();
      },
      ended: (): void => this.follow(),
    };
    const player = new StorePlayer(this.history, events, 1 - this.withPage);
    this.player = player;
    player.changed = () => this.changed();
    player.seek(Infinity);
    if (playing) player.play();
    this.topUp(); // what comes is kept from now on, whether the page is ready or not
    return player;
  }

  // What a person has repeated stays while they do; the frames up to `index` go.
  private holdRange(index: number): void {
    const { history, player } = this;
    if (player === null || player.loop === null || player.store !== history) return;
    let key = history.first + frameAt(history.times, player.loop.from);
    while (key > index && history.isKey(key) === false) --key;
    if (key <= index) player.store = history.held();
  }

  private becomeLive(): void {
    this.runs = this.run + 1;
    this.player?.stop();
    this.player = null;
    this.returning = false;
    if (!this.connected) this.events.lost();
    this.changed();
  }

  private onOpen(): void {
    this.withServer = 0;
    this.underWay.opened();
    if (this.live) {
      this.withPage = 0; // the page forgets them with the old connection
      this.events.open();
    }
    this.topUp();
  }

  private onFrame(prefix: FramePrefix, message: ArrayBuffer): void {
    --this.withServer;
    this.underWay.came(performance.now());
    const kept = this.history.add(prefix, message);
    if (kept !== null) this.tap?.(kept);
    if (this.live) {
      ++this.withPage;
      this.events.frame(prefix, message, false);
    } else {
      this.events.kept?.(message.byteLength);
      this.topUp();
      if (this.returning) this.player?.seek(Infinity);
    }
    this.changed();
  }

  private topUp(): void {
    const waits = this.resting ? 1 : 0; // a frame that is not drawn is replaced by the next one
    const more = this.underWay.frames + waits - this.withServer - (this.live ? this.withPage : 0);
    if (more <= 0 || !this.connected || (this.resting && this.tap === null)) return;
    if (this.withServer === 0) this.underWay.asked(performance.now());
    this.withServer += more;
    this.connection.credit(more);
  }
}
