// SPDX-License-Identifier: Apache-2.0
// The picture: what is seen of which surfaces, and what is drawn over it. Draws only when something changed, and again
// when the drawing before is done; who draws is the painter's matter.
import { hasPicture, wantsOf, type Display, type Mode, type Wants, type Way } from './display';
import { windowOf } from './dom';
import type { Drawing, Painter } from './drawing';
import { Ground, type Label } from './ground';
import type { DecodedFrame } from './messages';
import { Navigator } from './navigator';
import { Overlay, type Box } from './overlay';
import { loadStage, makePainter } from './painter';
import { steadyRange, type Range } from './palette';
import type { Pixels } from './pixels';
import { decodeVertexQuality } from './quality';
import type { Placement } from './placement';
import { kNowhere, type Rigid } from './rigid';
import type { Pinhole } from './protocol';
import { NoGraphics, Resolution, findGraphics } from './resolution';
import type { Stage } from './stage';
import { pickOf, Surfaces, type Beside, type Hit, type Seen, type Shown } from './surfaces';

const kStill_ms = 1000; // without a drawing: the picture stands still and can be as fine as the screen

export interface ViewEvents {
  /** Called right before a drawing; may call show(). */
  beforeDraw(): void;
  contextLost(lost: boolean): void;
  /** Nothing can be drawn. */
  failed(why: string): void;
  /** A person's hand left the rig's camera. */
  way(way: Way): void;
}

export class View {
  readonly navigator: Navigator;
  readonly overlay: Overlay;
  /** The processor draws, the rest of the page too. */
  readonly inSoftware: boolean;
  private readonly sizes: ResizeObserver;
  private ended = false;
  private ratio: number; // of what was drawn last
  private readonly painter: Painter;
  private headset: Stage | null = null; // draws while a person wears one, instead
  private readonly surfaces = new Surfaces();
  private readonly ground = new Ground();
  private scheduled = false;
  private readonly resolution = new Resolution();
  private painting = true; // until who draws is ready for the next
  private again = false; // something changed meanwhile
  private timing = false; // until the graphics are done with one of them
  private mode_: Mode = 'textured';
  private background_: string | null = null;
  private stillTimer = 0;
  private readonly page: Window & typeof globalThis; // that showed the canvas first: one in the background has late timers
  private range: Range | null = null;
  private grid = false;
  private smooth = false;
  private measuring_ = false;
  drawn = 0;

  /** Throws where there is no WebGL 2. `overlay` lies over `canvas`; `keys`: where those are listened to that move. */
  constructor(
    readonly canvas: HTMLCanvasElement,
    overlay: HTMLCanvasElement,
    private readonly events: ViewEvents,
    keys: EventTarget = window,
  ) {
    const graphics = findGraphics();
    if (graphics === null) throw new NoGraphics('there is no WebGL 2');
    this.inSoftware = graphics.inSoftware;
    this.painter = makePainter(canvas, graphics, {
      ready: () => this.painted(),
      took: (ms) => {
        this.timing = false;
        if (ms !== null) this.resolution.took(ms);
      },
      contextLost: (lost) => {
        if (this.ended) return;
        events.contextLost(lost);
        if (!lost) this.invalidate();
      },
      failed: (why) => events.failed(why),
    });
    this.overlay = new Overlay(overlay);
    const navigated = { changed: () => this.invalidate(), way: (way: Way) => events.way(way) };
    this.navigator = new Navigator(canvas, navigated, keys);
    this.page = windowOf(canvas);
    this.ratio = this.page.devicePixelRatio;
    this.sizes = new this.page.ResizeObserver(() => this.resize());
    this.sizes.observe(canvas);
    this.resize();
  }

  /** Of the first surface, where there are others beside it. */
  get name(): string {
    return this.surfaces.name;
  }
  set name(name: string) {
    this.surfaces.name = name;
  }

  set display(display: Display) {
    this.mode_ = display.mode;
    this.grid = display.grid;
    this.smooth = display.smooth;
    if (display.mode === 'confidence') this.tellQuality();
    if (this.navigator.way !== display.way) this.navigator.way = display.way;
    if (this.navigator.wantedFieldOfView !== display.fov) this.navigator.wantedFieldOfView = display.fov;
    this.invalidate();
  }
  /** A person measures. */
  set measuring(measuring: boolean) {
    this.measuring_ = measuring;
    if (measuring) this.tellQuality();
    this.invalidate();
  }
  get mode(): Mode {
    return this.mode_;
  }
  get wants(): Wants {
    const { frame } = this.surfaces.first;
    const wants = wantsOf(this.mode_, frame !== null && hasPicture(frame));
    return { ...wants, rims: wants.rims && this.drawsSmooth };
  }
  get shown(): DecodedFrame | null {
    return this.surfaces.first.frame;
  }
  /** Of the depth mode's colours. */
  get depthRange(): Range | null {
    return this.range;
  }
  get gridStep(): number | null {
    return this.showsGround ? this.ground.step : null;
  }

  /** The rig of the stream; the next surface sets the view, unless the view is to be kept. */
  restart(camera: Pinhole | null, keep: boolean): void {
    this.navigator.restart(camera, keep);
    if (!keep) this.surfaces.extent = null;
  }

  /** The first surface is seen no more. */
  clear(): void {
    const { first: surface } = this.surfaces;
    if (surface.frame === null) return;
    this.painter.remove(surface.id);
    this.headset?.remove(surface.id);
    surface.picture?.close();
    surface.frame = surface.picture = null;
    this.invalidate();
  }

  show(frame: DecodedFrame): void {
    const { surfaces } = this;
    this.paint(surfaces.first, frame);
    if (frame.extent === null) return;
    const isFirst = surfaces.extent === null;
    surfaces.extent = frame.extent;
    if (isFirst && !surfaces.isAlone) this.arrange();
    this.useExtent();
  }

  /** The surface of another stream; what it shows comes by showBeside(). All are seen when it appears, unless it `comesQuietly`. */
  addBeside(name: string, comesQuietly = false): Beside {
    return this.surfaces.add(name, comesQuietly);
  }

  removeBeside(beside: Beside): void {
    this.surfaces.remove(beside);
    this.painter.remove(beside.id);
    this.headset?.remove(beside.id);
    beside.picture?.close();
    this.arrange();
  }

  /** It gets its place by its first frame, and keeps it. */
  showBeside(beside: Beside, frame: DecodedFrame): void {
    this.paint(beside, frame);
    if (beside.extent !== null || frame.extent === null) return;
    beside.extent = frame.extent;
    this.arrange(beside.comesQuietly);
  }

  /** It is dimmed, and this stands with its name; empty: it is of now. */
  dimBeside(beside: Beside, word: string): void {
    if (beside.word === word) return;
    beside.word = word;
    this.invalidate();
  }

  set placement(placement: Placement) {
    if (placement === this.surfaces.placement) return;
    this.surfaces.placement = placement;
    this.arrange();
  }

  /** Where streams stand in the first one's frame, by name, as a person has placed them. */
  get placedByHand(): ReadonlyMap<string, Rigid> {
    return this.surfaces.known;
  }

  /** From now on; null: as others without a place. */
  place(name: string, pose: Rigid | null): void {
    if (pose === null) this.surfaces.known.delete(name);
    else this.surfaces.known.set(name, pose);
    this.arrange();
  }

  /** Where the rig of a stream says that its camera stands in the frame of all rigs; null: it does not say. */
  setRigPlace(name: string, place: Rigid | null): void {
    if (this.surfaces.setRigPlace(name, place) && !this.surfaces.isAlone) this.arrange(true);
  }

  /** Where a stream stands in the first one's frame, by a person's hand or else by both rigs; null: nothing says it. */
  placeOf(name: string): Rigid | null {
    return this.surfaces.placeOf(name);
  }

  /** Parts of the page lie there over the picture. */
  cover(boxes: readonly Box[]): void {
    this.overlay.covers = boxes;
    this.invalidate();
  }

  private arrange(quietly = false): void {
    this.surfaces.arrange();
    this.useExtent();
    if (!quietly) this.navigator.reset();
  }

  private useExtent(): void {
    const all = this.surfaces.around;
    if (all === null) return;
    this.ground.setExtent(all);
    this.range = steadyRange(...all.depths, this.range);
    this.navigator.setExtent(all);
  }

  /** What is at this place of the page (pixels of it, from the canvas' upper left corner): the first of all surfaces. */
  pick(at: { x: number; y: number }): Hit | null {
    const ray = this.navigator.ray(at);
    if (ray === null) return null;
    return pickOf(this.seen, ray);
  }

  /** All surfaces that are to be seen. */
  get seen(): Seen[] {
    return this.surfaces.seen(this.isRigView);
  }

  /** Of a stream's camera in the scene; null: its surface is not to be seen. */
  poseOf(stream: string): Rigid | null {
    return this.surfaces.poseOf(stream, this.isRigView);
  }

  /** Whether there is none beside the first. */
  get isAlone(): boolean {
    return this.surfaces.isAlone;
  }

  /** Whether lengths from this stream to another such one mean something. */
  standsTrue(name: string): boolean {
    return this.surfaces.standsTrue(name);
  }

  /** For good: gives back what it holds of the card. */
  end(): void {
    this.ended = true;
    this.sizes.disconnect();
    this.page.clearTimeout(this.stillTimer);
    this.navigator.end();
    this.painter.end();
    this.headset?.end();
    for (const { picture } of this.surfaces.all) picture?.close();
  }

  /** Draws for a headset until its session ends. Its origin, where the person is now, is the rig's camera. */
  async immerse(session: XRSession): Promise<void> {
    const Stage = await loadStage();
    // A headset is given what the page's own thread draws.
    const canvas = document.createElement('canvas');
    canvas.id = 'headset';
    canvas.hidden = true;
    this.canvas.after(canvas);
    const stage = new Stage(canvas, !this.inSoftware, { took: () => undefined, contextLost: () => undefined });
    session.addEventListener('end', () => {
      this.headset = null;
      window.setTimeout(() => {
        stage.end(); // behind what else hears of the session's end
        canvas.remove();
      });
      for (const shown of this.surfaces.all) this.repaint(shown, this.painter);
      this.resize();
      this.invalidate();
    });
    for (const shown of this.surfaces.all) this.repaint(shown, stage);
    this.headset = stage;
    await stage.immerse(session, () => {
      if (!this.ended) this.events.beforeDraw();
      ++this.drawn;
      return this.drawing(1);
    });
  }

  /** To be called now and then: a window that is moved to another screen keeps its size on the page, and not every browser tells of it. */
  refresh(): void {
    if (windowOf(this.canvas).devicePixelRatio !== this.ratio) this.invalidate();
  }

  invalidate(): void {
    // A headset draws at its own beat, and the page's stands still.
    if (this.scheduled || this.ended || this.headset !== null) return;
    if (this.painting) {
      this.again = true;
      return;
    }
    this.scheduled = true;
    windowOf(this.canvas).requestAnimationFrame((now) => {
      if (!this.ended) this.events.beforeDraw();
      this.scheduled = false; // what changed until here is drawn now, not once more
      if (this.ended || this.headset !== null) return;
      this.navigator.update(now);
      this.render(this.isFilmed ? 1 : this.resolution.scale);
    });
  }

  /** Whether something will be drawn without anything happening before: motion that dies away, a finer picture. */
  get isBusy(): boolean {
    return this.scheduled || this.painting || this.timing || this.stillTimer !== 0;
  }

  /** Of the screen's pixels that are drawn while the picture moves. */
  get movingScale(): number {
    return this.resolution.scale;
  }

  /** What is on the screen, as fine as that is: drawn anew. */
  pixels(): Promise<Pixels> {
    return this.painter.read(this.drawing(1)); // what is seen does not depend on how quickly it was drawn
  }

  /** The same as a PNG file, transparent where nothing is, and as if no panel were open; null: the browser cannot. */
  png(): Promise<Blob | null> {
    return this.painter.png({ ...this.drawing(1), projection: this.navigator.bareProjection });
  }

  /**
   * While a video is made of the canvas: `ground` is behind the surface, where the page shows through, all pictures are of
   * one size, as fine as the screen, and panels do not move them. Resolves when the canvas is so.
   */
  async film(ground: string): Promise<void> {
    this.background_ = ground;
    this.navigator.ignoresPanels = true;
    this.invalidate();
    await this.pixels();
  }

  endFilm(): void {
    this.background_ = null;
    this.navigator.ignoresPanels = false;
    this.invalidate();
  }

  private get isFilmed(): boolean {
    return this.background_ !== null;
  }

  // The rig's camera sees none.
  private get showsGround(): boolean {
    return this.grid && this.surfaces.first.frame !== null && !this.isRigView;
  }

  // Where numbers are read, and in the picture of the rig's camera, all is drawn that there is.
  private get drawsSmooth(): boolean {
    return this.smooth && !this.measuring_ && !this.isRigView;
  }

  private get isRigView(): boolean {
    return this.navigator.isRigView && this.headset === null;
  }

  private paint(shown: Shown, frame: DecodedFrame): void {
    shown.frame = frame;
    if (this.headset !== null) this.headset.show(shown.id, frame);
    else this.painter.show(shown.id, frame);
    frame.handOn?.close(); // where it was not handed on
    frame.handOn = null;
    if (frame.texture === null) return;
    if (shown.picture !== frame.texture) shown.picture?.close();
    shown.picture = frame.texture;
  }

  // Of the frames at hand, which came before anybody wanted it: where a stream stands still no other comes.
  private tellQuality(): void {
    for (const shown of this.surfaces.all) {
      const { frame } = shown;
      if (frame?.codedQuality == null || frame.coordinates === null) continue;
      try {
        shown.frame = { ...frame, quality: decodeVertexQuality(frame.codedQuality, frame.coordinates), codedQuality: null };
      } catch {
        continue; // damaged, as the decoder would have told of a later one
      }
      this.repaint(shown, this.headset ?? this.painter);
    }
  }

  private repaint({ id, frame }: Shown, by: Pick<Painter, 'show'>): void {
    if (frame !== null) by.show(id, frame);
  }

  /** `scale`: of the screen's pixels. */
  private drawing(scale: number, timed = false): Drawing {
    const { camera, size, rigCamera } = this.navigator;
    const poses: (Rigid | null)[] = [kNowhere];
    // Another rig's camera sees something else.
    for (const [i, { id }] of this.surfaces.besides.entries()) poses[id] = this.isRigView ? null : this.surfaces.pose(i + 1);
    camera.updateMatrixWorld();
    return {
      ...size,
      ratio: Math.min(windowOf(this.canvas).devicePixelRatio, 2) * scale,
      world: camera.matrixWorld.toArray(),
      projection: camera.projectionMatrix.toArray(),
      mode: this.mode_,
      lens: this.isRigView ? rigCamera : null,
      range: this.range,
      ground: this.showsGround ? this.ground.ranges : null,
      poses,
      dimmed: this.surfaces.besides.flatMap(({ id, word }) => (word === '' ? [] : [id])),
      background: this.background_,
      smooth: this.drawsSmooth,
      timed,
    };
  }

  private painted(): void {
    this.painting = false;
    if (!this.again) return;
    this.again = false;
    this.invalidate();
  }

  private render(scale: number): void {
    const drawing = this.drawing(scale, !this.canvas.ownerDocument.hidden && !this.isFilmed);
    this.painting = true;
    this.timing ||= drawing.timed;
    this.ratio = windowOf(this.canvas).devicePixelRatio;
    this.painter.draw(drawing);
    ++this.drawn;
    this.overlay.draw((point) => this.navigator.toPage(point), this.labels);
    this.page.clearTimeout(this.stillTimer);
    this.stillTimer = 0;
    if (scale === 1) return;
    this.stillTimer = this.page.setTimeout(() => {
      this.stillTimer = 0;
      if (this.painting) this.again = true;
      else if (this.headset === null) this.render(1);
    }, kStill_ms);
  }

  private get labels(): readonly Label[] {
    const ground = this.showsGround ? this.ground.labels : [];
    if (this.isAlone || this.navigator.isRigView) return ground;
    return [...this.surfaces.labels, ...ground]; // the first ones have their place
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.canvas;
    if (clientWidth === 0 || clientHeight === 0 || this.headset !== null) return;
    if (clientWidth === this.navigator.size.width && clientHeight === this.navigator.size.height) return;
    this.navigator.resize({ width: clientWidth, height: clientHeight });
  }
}
