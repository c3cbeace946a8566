// SPDX-License-Identifier: Apache-2.0
// One source being watched: its frames through the decoder to the picture, and what it says of itself.
import { utcNow } from './connection';
import { Decoder } from './decoder';
import { closePictures } from './frameMemory';
import type { DecodedFrame } from './messages';
import { Meter } from './meter';
import { offeredRungs, type FramePrefix, type Rung, type ServerMessage, type StreamInfo, type StreamStatus } from './protocol';
import type { FrameSource, SourceEvents } from './source';
import type { Facts } from './state';
import { ServerDrops } from './statistics';

export interface SessionEvents {
  /** What is known of the source has changed. */
  changed(): void;
  /** The description of a stream came; `seen`: a frame of it was shown before, of the same source. */
  described(info: StreamInfo, seen: boolean): void;
  /** A frame waits to be drawn: take() it. */
  ready(): void;
  hint(text: string): void;
  unusable(message: string): void;
  /** As SourceEvents has it. */
  signIn?(): void;
}

interface Waiting {
  frame: DecodedFrame;
  prefix: FramePrefix;
  run: string;
}

export class Session {
  readonly decoder: Decoder;
  readonly meter = new Meter();
  source: FrameSource | null = null;
  info: StreamInfo | null = null; // while the stream is announced
  status: StreamStatus | null = null;
  rung: Rung = 'full'; // how much detail comes now
  rungs: readonly Rung[] = ['full']; // and could come, as far as the server has said
  seen = false; // a frame was shown
  private sourceName = ''; // of the info before
  lastFrameAt = 0;
  everConnected = false;
  run = ''; // of the frame taken last: those of one were played, or came live, one after the other
  private readonly underway = new Map<number, { prefix: FramePrefix; forLater: boolean; run: string }>(); // in the decoder
  private waiting: Waiting | null = null; // decoded, not drawn
  private taken: DecodedFrame | null = null; // drawn now
  private watched = 0; // sources so far
  private live = false; // the frame that came last
  private readonly serverDrops = new ServerDrops();
  private unseen = false; // nobody sees the picture, though the page is seen
  private readonly onHidden = (): void => {
    this.interrupt();
    this.events.changed();
  };

  /** `page`: shows it. */
  constructor(
    private readonly events: SessionEvents,
    private readonly page = document,
  ) {
    const decoderEvents = {
      decoded: (frame: DecodedFrame) => this.onDecoded(frame),
      failed: (id: number, message: string) => this.onFailed(id, message),
      unusable: (message: string) => events.unusable(message),
    };
    this.decoder = new Decoder(decoderEvents, page.defaultView ?? window);
    page.addEventListener('visibilitychange', this.onHidden);
  }

  /** For good. */
  end(): void {
    this.watch(null);
    this.decoder.stop();
    this.page.removeEventListener('visibilitychange', this.onHidden);
  }

  /** Whether a frame that has come is on its way to the screen. */
  get isBusy(): boolean {
    return this.underway.size > 0 || this.waiting !== null;
  }

  /** What is known of its source. */
  get facts(): Omit<Facts, 'problem' | 'stream' | 'hint'> {
    const { source, info, status } = this;
    const playing = source === null ? null : source.playback.playing ? 'playing' : 'paused';
    const following = source?.playback.following ?? null; // null: of a recording
    return {
      everConnected: this.everConnected,
      connected: source?.connected ?? true,
      retryInS: source?.retryInS ?? null,
      refusal: source?.refusal ?? null,
      announced: info !== null,
      seen: this.seen,
      serverState: status?.state ?? null,
      serverMessage: status?.message ?? '',
      quietMs: this.rests ? 0 : performance.now() - this.lastFrameAt, // else nothing is asked for
      frameRate: info?.frame_rate ?? 0,
      file: following === null ? playing : null,
      missing: source?.missing ?? null,
      shifted: following === false ? playing : null,
    };
  }

  /** From now on, instead of what was watched before; null: nothing. */
  watch(open: ((events: SourceEvents) => FrameSource) | null): void {
    this.source?.stop();
    ++this.watched;
    this.forget();
    this.info = this.status = null;
    this.seen = false;
    this.rung = 'full';
    this.rungs = ['full'];
    this.serverDrops.restart();
    this.meter.begin();
    this.source = null;
    this.unseen = false;
    if (open === null) return;
    this.source = open({
      open: () => {
        this.everConnected = true;
        this.forget(); // their credit went with the old connection
        this.meter.restart();
        this.events.changed();
      },
      lost: () => {
        this.info = this.status = null;
        this.events.changed();
      },
      message: (message) => this.onMessage(message),
      frame: (prefix, bytes, forLater) => this.onFrame(prefix, bytes, forLater),
      kept: (bytes) => this.meter.came(bytes, performance.now()),
      clock: (t0, serverMs, t1) => this.meter.clock.add(t0, serverMs, t1),
      nonsense: (message) => this.meter.failed(message),
      signIn: () => {
        if (this.source?.live === true) this.events.signIn?.(); // else a person looks at what only this page has
      },
      timers: this.page.defaultView ?? window,
    });
    this.source.rest?.(this.rests);
  }

  /** Whether nobody sees the picture: then as little as can be is to come. A page in the background knows it by itself. */
  rest(unseen: boolean): void {
    if (unseen === this.unseen) return;
    this.unseen = unseen;
    this.interrupt();
  }

  private get rests(): boolean {
    return this.unseen || this.page.hidden;
  }

  /** The frame to draw now instead of the one before, whose memory is used again, if there is one. */
  take(): DecodedFrame | null {
    if (this.waiting === null) return null;
    const { frame, prefix, run } = this.waiting;
    this.waiting = null;
    this.run = run;
    this.meter.shown(frame, prefix, utcNow(), performance.now(), this.source?.live === true);
    this.source?.credit();
    this.seen = true;
    if (this.taken !== null) this.decoder.giveBack(this.taken); // the one that is returned takes its place
    this.taken = frame;
    return frame;
  }

  private onMessage(message: ServerMessage): void {
    if (message.type === 'info') {
      if (this.info === null) this.meter.restart();
      this.info = message;
      this.lastFrameAt = performance.now();
      this.events.described(message, this.seen && message.source === this.sourceName);
      this.sourceName = message.source;
    } else if (message.type === 'status') {
      this.status = this.serverDrops.since(message);
      this.rungs = offeredRungs(message);
    } else if (message.type === 'quality') {
      this.rung = message.now;
    } else if (message.type === 'waiting' || message.type === 'gone') {
      this.info = this.status = null;
      if (message.type === 'waiting') this.events.hint(message.hint);
    }
    this.events.changed();
  }

  private onFrame(prefix: FramePrefix, bytes: ArrayBuffer, forLater: boolean): void {
    this.lastFrameAt = performance.now();
    const live = this.source?.live === true;
    if (live !== this.live) this.meter.pause(); // what was left out in going back or returning is no loss
    this.live = live;
    const isKept = !live && this.source?.kept != null; // it came before
    if (!forLater && !isKept) this.meter.came(bytes.byteLength, this.lastFrameAt);
    if (!forLater) this.meter.arrived(prefix, bytes, this.lastFrameAt, live);
    const run = `${this.watched} ${this.source?.playback.run ?? 0}`;
    this.underway.set(this.decoder.decode(bytes, prefix.bytes), { prefix, forLater, run });
  }

  private onDecoded(frame: DecodedFrame): void {
    const known = this.underway.get(frame.id);
    this.underway.delete(frame.id);
    if (known === undefined || known.forLater) {
      closePictures(frame); // of a stream that is no longer watched, or wanted only by the decoder
      return;
    }
    if (this.discard()) {
      ++this.meter.skipped;
      this.source?.credit(1, false);
    }
    this.meter.decoded(known.prefix, utcNow());
    this.waiting = { frame, prefix: known.prefix, run: known.run };
    this.events.ready();
  }

  private onFailed(id: number, message: string): void {
    this.meter.failed(message);
    if (this.underway.get(id)?.forLater === false) this.source?.credit(1, false);
    this.underway.delete(id);
  }

  private forget(): void {
    this.underway.clear();
    this.discard();
  }

  // Neither is what does not come meanwhile lost, nor is the source silent.
  private interrupt(): void {
    this.meter.pause();
    this.lastFrameAt = performance.now();
    this.source?.rest?.(this.rests);
  }

  private discard(): boolean {
    const had = this.waiting !== null;
    if (this.waiting !== null) closePictures(this.waiting.frame);
    this.waiting = null;
    return had;
  }
}
