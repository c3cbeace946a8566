// SPDX-License-Identifier: Apache-2.0
// Draws on the page's canvas from a thread of its own, so that slow graphics do not hold up the page. Where the page itself
// has to draw it imports this file for what it exports.
import { buffersOf } from './frameMemory';
import { Stage } from './stage';
import type { StageReply, StageRequest } from './stageMessages';

export { Stage };

let stage: Stage | null = null;
// What is shown, by surface.
const buffers = new Map<number, ArrayBuffer[]>();
const pictures = new Map<number, ImageBitmap>();

function reply(message: StageReply, transfer: Transferable[] = []): void {
  self.postMessage(message, { transfer });
}

async function hear(event: MessageEvent<StageRequest>): Promise<void> {
  const request = event.data;
  try {
    if (request.type === 'start') {
      stage = new Stage(request.canvas, request.antialias, {
        took: (ms) => reply({ type: 'took', ms }),
        contextLost: (lost) => reply({ type: 'contextLost', lost }),
      });
      return reply({ type: 'ready' });
    }
    if (stage === null) return; // told before
    if (request.type === 'show') {
      const { surface, frame } = request;
      stage.show(surface, frame);
      const before = buffers.get(surface) ?? [];
      reply({ type: 'spares', buffers: before }, before);
      buffers.set(surface, buffersOf(frame));
      if (frame.texture === null) return;
      pictures.get(surface)?.close();
      pictures.set(surface, frame.texture);
    } else if (request.type === 'remove') {
      stage.remove(request.surface);
      pictures.get(request.surface)?.close();
      pictures.delete(request.surface);
      buffers.delete(request.surface);
    } else if (request.type === 'draw') {
      stage.draw(request.drawing);
      reply({ type: 'ready' });
    } else if (request.type === 'read') {
      const answer = stage.read(request.drawing);
      reply({ type: 'answer', id: request.id, answer }, [answer.rgba.buffer]);
    } else {
      reply({ type: 'answer', id: request.id, answer: await stage.png(request.drawing) });
    }
  } catch (error) {
    reply({ type: 'failed', why: error instanceof Error ? error.message : String(error) });
  }
}

if (typeof document === 'undefined') self.onmessage = (event: MessageEvent<StageRequest>) => void hear(event);
