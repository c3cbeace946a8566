// SPDX-License-Identifier: Apache-2.0
// When a drawing begins, and when it is shown. A graphics card draws on the screen's beat and nobody waits for it.
// Where the processor draws, browsers read each drawing back when they put the page together, and the page's thread
// stands still until it is finished: so there it is drawn beside the canvas, and copied onto it when it is done.

const kPoll_ms = 2;

export interface Drawing {
  /** Asks the card for what is to be seen at `now` (performance.now()). */
  draw(now: number): void;
  /** It is on the canvas from here on: copies it there where it was drawn beside it. */
  show(): void;
  /** How long the card, or the processor in its place, took for it. */
  took(ms: number): void;
}

export class Beat {
  private asked = false;
  private underWay = false; // drawn beside the canvas, not shown yet
  private fence: WebGLSync | null = null; // of a drawing that is being timed
  private stopped = false;

  /** `beside`: it is drawn beside the canvas. */
  constructor(
    private readonly gl: WebGL2RenderingContext,
    private readonly beside: boolean,
    private readonly drawing: Drawing,
  ) {}

  /** Something has changed: it is drawn once, soon. */
  ask(): void {
    if (this.asked || this.stopped) return;
    this.asked = true;
    if (!this.underWay) this.begin();
  }

  stop(): void {
    this.stopped = true;
  }

  get isBusy(): boolean {
    return this.asked || this.underWay || this.fence !== null;
  }

  // Beside the canvas it need not wait for the screen; that of a hidden page shows nothing, and then draws nothing.
  private begin(): void {
    if (this.beside && !document.hidden) window.setTimeout(() => this.draw(performance.now()));
    else requestAnimationFrame((now) => this.draw(now));
  }

  private draw(now: number): void {
    if (this.stopped) return;
    this.drawing.draw(now);
    this.asked = false; // what changed until here is drawn now, not once more
    this.underWay = this.beside;
    if (!this.beside) this.drawing.show();
    this.time();
  }

  private time(): void {
    if (this.fence !== null || (!this.beside && document.hidden)) return;
    const { gl } = this;
    this.fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    if (this.fence === null) return this.finished(); // the context is lost
    gl.flush();
    const start = performance.now();
    const poll = (): void => {
      if (this.fence === null) return;
      const status = gl.getSyncParameter(this.fence, gl.SYNC_STATUS) as number | null;
      if (status === gl.UNSIGNALED) {
        window.setTimeout(poll, kPoll_ms);
        return;
      }
      gl.deleteSync(this.fence);
      this.fence = null;
      if (status === gl.SIGNALED) this.drawing.took(performance.now() - start);
      this.finished();
    };
    window.setTimeout(poll, kPoll_ms);
  }

  // The next drawing begins when the page has been put together: until then the page would wait for that one too.
  private finished(): void {
    if (!this.beside || this.stopped) return;
    requestAnimationFrame(() => {
      if (this.stopped) return;
      this.drawing.show();
      this.underWay = false;
      if (this.asked) this.begin();
    });
  }
}
