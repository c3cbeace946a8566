// SPDX-License-Identifier: Apache-2.0
// Where the picture is drawn: by a worker, where the browser lets workers draw, else by this page.
import type { Drawing, Drawn, Painter, PainterEvents } from './drawing';
import { take } from './early';
import { buffersOf } from './frameMemory';
import type { DecodedFrame } from './messages';
import type { Pixels } from './pixels';
import type { Graphics } from './resolution';
import type { Stage } from './stage';
import stageUrl from 'virtual:stage-url';
import type { StageReply, StageRequest } from './stageMessages';
import { Spares } from './spares';
import { startStage } from './workers';

/** On this page's thread, from the worker's own file. Loaded when it is needed. */
export async function loadStage(): Promise<typeof Stage> {
  const module = (await import(/* @vite-ignore */ stageUrl)) as typeof import('./stage.worker');
  return module.Stage;
}

export function makePainter(canvas: HTMLCanvasElement, graphics: Graphics, events: PainterEvents): Painter {
  // Four samples a pixel cost a processor that draws more than all the rest.
  const antialias = !graphics.inSoftware;
  if (graphics.ofWorkers) return new FarPainter(canvas, antialias, events);
  take<Worker>('stage')?.terminate();
  return new NearPainter(canvas, antialias, events);
}

class FarPainter implements Painter {
  private readonly worker = take<Worker>('stage') ?? startStage();
  private readonly asked = new Map<number, (answer: unknown) => void>();
  private readonly spares = new Spares();
  private nextId = 1;

  constructor(canvas: HTMLCanvasElement, antialias: boolean, events: PainterEvents) {
    this.worker.onmessage = (event: MessageEvent<StageReply>) => {
      const reply = event.data;
      if (reply.type === 'ready') events.ready();
      if (reply.type === 'took') events.took(reply.ms);
      if (reply.type === 'spares') this.spares.add(reply.buffers);
      if (reply.type === 'contextLost') events.contextLost(reply.lost);
      if (reply.type === 'failed') events.failed(reply.why);
      if (reply.type === 'answer') {
        this.asked.get(reply.id)?.(reply.answer);
        this.asked.delete(reply.id);
      }
    };
    this.worker.onerror = (event) => {
      event.preventDefault();
      events.failed(event.message || 'what draws cannot be loaded');
    };
    const offscreen = canvas.transferControlToOffscreen();
    this.say({ type: 'start', canvas: offscreen, antialias }, [offscreen]);
  }

  show(surface: number, { positions, coordinates, normals, triangles, edges, quality, rims, colours, texture, handOn }: DecodedFrame): void {
    const copy = <T extends Float32Array | Uint32Array | Uint8Array>(array: T): T => this.spares.copy(array);
    const frame: Drawn = {
      positions: copy(positions),
      coordinates: coordinates && copy(coordinates),
      normals: normals && copy(normals),
      triangles: copy(triangles),
      edges: edges && copy(edges),
      quality: quality && { sigmas: copy(quality.sigmas), interpolated: copy(quality.interpolated) },
      rims: rims ? copy(rims) : null,
      colours: colours ? copy(colours) : null,
      texture: handOn ?? texture,
    };
    this.say({ type: 'show', surface, frame }, handOn == null ? buffersOf(frame) : [...buffersOf(frame), handOn]);
  }
  remove(surface: number): void {
    this.say({ type: 'remove', surface });
  }
  draw(drawing: Drawing): void {
    this.say({ type: 'draw', drawing });
  }
  read(drawing: Drawing): Promise<Pixels> {
    return this.ask('read', drawing) as Promise<Pixels>;
  }
  png(drawing: Drawing): Promise<Blob | null> {
    return this.ask('png', drawing) as Promise<Blob | null>;
  }
  end(): void {
    this.worker.terminate();
    for (const answer of this.asked.values()) answer(null); // it gives none any more
    this.asked.clear();
  }

  private ask(type: 'read' | 'png', drawing: Drawing): Promise<unknown> {
    const id = this.nextId++;
    return new Promise((resolve) => {
      this.asked.set(id, resolve);
      this.say({ type, drawing, id });
    });
  }
  private say(request: StageRequest, transfer: Transferable[] = []): void {
    this.worker.postMessage(request, transfer);
  }
}

class NearPainter implements Painter {
  private readonly stage: Promise<Stage>; // loaded where workers do not draw

  constructor(
    canvas: HTMLCanvasElement,
    antialias: boolean,
    private readonly events: PainterEvents,
  ) {
    this.stage = loadStage().then((Stage) => new Stage(canvas, antialias, events));
    this.stage.then(events.ready, (error: unknown) => events.failed(error instanceof Error ? error.message : String(error)));
  }

  show(surface: number, frame: DecodedFrame): void {
    this.onStage((stage) => stage.show(surface, frame));
  }
  remove(surface: number): void {
    this.onStage((stage) => stage.remove(surface));
  }
  draw(drawing: Drawing): void {
    this.onStage((stage) => {
      stage.draw(drawing);
      this.events.ready();
    });
  }
  read(drawing: Drawing): Promise<Pixels> {
    return this.stage.then((stage) => stage.read(drawing));
  }
  png(drawing: Drawing): Promise<Blob | null> {
    return this.stage.then((stage) => stage.png(drawing));
  }
  end(): void {
    this.onStage((stage) => stage.end());
  }

  private onStage(act: (stage: Stage) => void): void {
    void this.stage.then(act, () => undefined); // that there is none was told
  }
}
