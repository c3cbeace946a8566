// SPDX-License-Identifier: Apache-2.0
// The page's side of the decoding worker. A decoder that hangs is replaced.
import type { Wants } from './display';
import { take } from './early';
import { buffersOf } from './frameMemory';
import type { DecodedFrame, DecodeReply, DecodeRequest } from './messages';
import { startDecoder } from './workers';

const kPatienceMs = 10_000;

export interface DecoderEvents {
  decoded(frame: DecodedFrame): void;
  failed(id: number, message: string): void;
  /** No frame will ever be decoded. */
  unusable(message: string): void;
}

export class Decoder {
  want: Wants = { normals: false, edges: false, quality: false, rims: false };
  private worker: Worker;
  private nextId = 1;
  private spares: ArrayBuffer[] = []; // go with the next request
  private readonly pending = new Map<number, number>(); // id -> when it was handed over
  private ready = false;
  private readonly timer: number;

  /** `timers`: of the window that is seen, as those of one in the background come late. */
  constructor(
    private readonly events: DecoderEvents,
    private readonly timers: Window = window,
  ) {
    this.worker = this.start();
    this.timer = timers.setInterval(() => this.watch(), 1000);
  }

  /** Takes the message's bytes; the answer carries the id returned. */
  decode(bytes: ArrayBuffer, offset: number): number {
    const id = this.nextId++;
    this.pending.set(id, performance.now());
    const spares = this.spares.splice(0);
    const request: DecodeRequest = { type: 'decode', id, bytes, offset, want: { ...this.want }, spares };
    this.worker.postMessage(request, [bytes, ...spares]);
    return id;
  }

  /** Takes the memory of a frame that nobody looks at any more. */
  giveBack(frame: DecodedFrame): void {
    if (frame.kept === true) return;
    this.spares = buffersOf(frame);
  }

  /** For good. */
  stop(): void {
    this.timers.clearInterval(this.timer);
    this.worker.terminate();
    this.pending.clear();
  }

  private start(): Worker {
    const worker = take<Worker>('decoder') ?? startDecoder();
    this.ready = false;
    worker.onmessage = (event: MessageEvent<DecodeReply>) => {
      const reply = event.data;
      if (reply.type === 'ready') this.onReady();
      if (reply.type === 'loading') this.ready = false;
      if (reply.type === 'unusable') this.events.unusable(reply.message);
      if (reply.type === 'frame' && this.pending.delete(reply.id)) this.events.decoded(reply);
      if (reply.type === 'failed' && this.pending.delete(reply.id)) this.events.failed(reply.id, reply.message);
    };
    worker.onerror = (event) => {
      event.preventDefault();
      if (!this.ready) this.events.unusable(event.message || 'the decoder cannot be loaded');
    };
    return worker;
  }

  // What waited for the network did not hang.
  private onReady(): void {
    this.ready = true;
    const now = performance.now();
    for (const id of this.pending.keys()) this.pending.set(id, now);
  }

  private watch(): void {
    const oldest = Math.min(...this.pending.values());
    if (!this.ready || performance.now() - oldest < kPatienceMs) return;
    this.worker.terminate();
    const lost = [...this.pending.keys()];
    this.pending.clear();
    this.worker = this.start();
    for (const id of lost) this.events.failed(id, 'decoding took longer than 10 s');
  }
}
