// SPDX-License-Identifier: Apache-2.0
// The picture: what is seen of which surfaces, and what is drawn over it. Draws only when something changed, and again
// when the drawing before is done; who draws is the painter's matter.
import { hasPicture, wantsOf, type Display, type Mode, type Wants, type Way } from './display';
import type { Drawing, Painter } from './drawing';
import { Ground, type Label } from './ground';
import type { DecodedFrame } from './messages';
import { Navigator } from './navigator';
import { Overlay } from './overlay';
import { loadStage, makePainter } from './painter';
import { steadyRange, type Range } from './palette';
import { pick, type Picked } from './pick';
import type { Pixels } from './pixels';
import { decodeVertexQuality } from './quality';
import { around, between, placed, type Placement } from './placement';
import { inverse, kNowhere, moved, turned, type Rigid } from './rigid';
import type { Pinhole } from './protocol';
import { NoGraphics, Resolution, findGraphics } from './resolution';
import type { Stage } from './stage';
import { text } from './strings';
import type { Extent } from './surface';

const kStill_ms = 1000; // without a drawing: the picture stands still and can be as fine as the screen
const kFirst = 0; // number of the first surface, for the painter

/** A surface, in a frame of its own camera. */
interface Shown {
  readonly id: number; // for the painter
  frame: DecodedFrame | null;
  picture: ImageBitmap | null; // the last there was: to be closed when another takes its place
}

/** A surface beside the first one. */
export interface Beside extends Shown {
  readonly name: string;
  extent: Extent | null; // of its first frame
  readonly comesQuietly: boolean; // the eye stays where it is
  word: string; // what is said of it where it is not of now; empty: it is
}

/** A place of one of the surfaces, in the frame of its own camera. */
export interface Hit extends Picked {
  readonly stream: string;
  readonly surface: DecodedFrame;
  readonly pose: Rigid; // of that frame in the scene's
}

/** A stream's surface as it is shown. */
export interface Seen {
  readonly stream: string;
  readonly surface: DecodedFrame;
  readonly pose: Rigid; // of its camera in the scene
  readonly picture: ImageBitmap | null; // of that surface; open until the next is shown
}

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
  private readonly sizes = new ResizeObserver(() => this.resize());
  private ended = false;
  private readonly painter: Painter;
  private headset: Stage | null = null; // draws while a person wears one, instead
  private readonly surface: Shown = { id: kFirst, frame: null, picture: null };
  private nextId = kFirst + 1;
  private readonly ground = new Ground();
  private readonly besides: Beside[] = [];
  private placement_: Placement = 'beside';
  private extent: Extent | null = null; // of the first surface
  private poses: Rigid[] = [kNowhere]; // of the first surface and those beside it
  private readonly known = new Map<string, Rigid>(); // where a person has placed streams, by name
  private readonly rigPlaces = new Map<string, Rigid>(); // where their rigs say that they stand
  /** Of the first surface, where there are others beside it. */
  name = '';
  private scheduled = false;
  private readonly resolution = new Resolution();
  private painting = true; // until who draws is ready for the next
  private again = false; // something changed meanwhile
  private timing = false; // until the graphics are done with one of them
  private mode_: Mode = 'textured';
  private background_: string | null = null;
  private stillTimer = 0;
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
    this.sizes.observe(canvas);
    this.resize();
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
    const { frame } = this.surface;
    const wants = wantsOf(this.mode_, frame !== null && hasPicture(frame));
    return { ...wants, rims: wants.rims && this.drawsSmooth };
  }
  get shown(): DecodedFrame | null {
    return this.surface.frame;
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
    if (!keep) this.extent = null;
  }

  /** The first surface is seen no more. */
  clear(): void {
    const { surface } = this;
    if (surface.frame === null) return;
    this.painter.remove(surface.id);
    this.headset?.remove(surface.id);
    surface.picture?.close();
    surface.frame = surface.picture = null;
    this.invalidate();
  }

  show(frame: DecodedFrame): void {
    this.paint(this.surface, frame);
    if (frame.extent === null) return;
    const isFirst = this.extent === null;
    this.extent = frame.extent;
    if (isFirst && this.besides.length > 0) this.arrange();
    this.useExtent();
  }

  /** The surface of another stream; what it shows comes by showBeside(). All are seen when it appears, unless it `comesQuietly`. */
  addBeside(name: string, comesQuietly = false): Beside {
    const beside: Beside = { id: this.nextId++, name, frame: null, picture: null, extent: null, comesQuietly, word: '' };
    this.besides.push(beside);
    return beside;
  }

  removeBeside(beside: Beside): void {
    this.besides.splice(this.besides.indexOf(beside), 1);
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
    if (placement === this.placement_) return;
    this.placement_ = placement;
    this.arrange();
  }

  /** Where streams stand in the first one's frame, by name, as a person has placed them. */
  get placedByHand(): ReadonlyMap<string, Rigid> {
    return this.known;
  }

  /** From now on; null: as others without a place. */
  place(name: string, pose: Rigid | null): void {
    if (pose === null) this.known.delete(name);
    else this.known.set(name, pose);
    this.arrange();
  }

  /** Where the rig of a stream says that its camera stands in the frame of all rigs; null: it does not say. */
  setRigPlace(name: string, place: Rigid | null): void {
    if (JSON.stringify(place) === JSON.stringify(this.rigPlaces.get(name) ?? null)) return;
    if (place === null) this.rigPlaces.delete(name);
    else this.rigPlaces.set(name, place);
    if (this.besides.length > 0) this.arrange(true);
  }

  /** Where a stream stands in the first one's frame, by a person's hand or else by both rigs; null: nothing says it. */
  placeOf(name: string): Rigid | null {
    return this.known.get(name) ?? between(this.rigPlaces.get(this.name), this.rigPlaces.get(name));
  }

  private get surfaces(): Shown[] {
    return [this.surface, ...this.besides];
  }
  private get names(): string[] {
    return [this.name, ...this.besides.map(({ name }) => name)];
  }
  private get extents(): (Extent | null)[] {
    return [this.extent, ...this.besides.map(({ extent }) => extent)];
  }

  private arrange(quietly = false): void {
    this.poses = placed(this.extents, this.placement_, [null, ...this.besides.map(({ name }) => this.placeOf(name))]);
    this.useExtent();
    if (!quietly) this.navigator.reset();
  }

  private useExtent(): void {
    const all = this.besides.length === 0 ? this.extent : around(this.extents, this.poses);
    if (all === null) return;
    this.ground.setExtent(all);
    this.range = steadyRange(all.min[2], all.max[2], this.range);
    this.navigator.setExtent(all);
  }

  /** What is at this place of the page (pixels of it, from the canvas' upper left corner): the first of all surfaces. */
  pick(at: { x: number; y: number }): Hit | null {
    const ray = this.navigator.ray(at);
    if (ray === null) return null;
    let first: Hit | null = null;
    for (const { stream, surface, pose } of this.seen) {
      const back = inverse(pose);
      const picked = pick(surface, moved(back, ray.origin), turned(back, ray.direction));
      if (picked !== null && (first === null || picked.along < first.along)) first = { ...picked, stream, surface, pose };
    }
    return first;
  }

  /** All surfaces that are to be seen. */
  get seen(): Seen[] {
    return this.surfaces.flatMap(({ frame: surface, picture }, i) => {
      const stream = this.names[i]!;
      const pose = this.poseOf(stream);
      return surface === null || pose === null ? [] : [{ stream, surface, pose, picture }];
    });
  }

  /** Of a stream's camera in the scene; null: its surface is not to be seen. */
  poseOf(stream: string): Rigid | null {
    const i = this.names.indexOf(stream);
    return i < 0 || (i > 0 && this.isRigView) ? null : (this.poses[i] ?? kNowhere);
  }

  /** Whether there is none beside the first. */
  get isAlone(): boolean {
    return this.besides.length === 0;
  }

  /**
   * Whether lengths from this stream to another such one mean something: it stands where both rigs say, or in the first
   * one's frame because a person has put all there. Places clicked by hand are too inexact, side by side means nothing.
   */
  standsTrue(name: string): boolean {
    if (name === this.name) return true;
    if (this.known.has(name)) return false;
    return this.placement_ === 'together' || this.placeOf(name) !== null;
  }

  /** For good: gives back what it holds of the card. */
  end(): void {
    this.ended = true;
    this.sizes.disconnect();
    window.clearTimeout(this.stillTimer);
    this.navigator.end();
    this.painter.end();
    this.headset?.end();
    for (const { picture } of this.surfaces) picture?.close();
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
      for (const shown of this.surfaces) this.repaint(shown, this.painter);
      this.resize();
      this.invalidate();
    });
    for (const shown of this.surfaces) this.repaint(shown, stage);
    this.headset = stage;
    await stage.immerse(session, () => {
      if (!this.ended) this.events.beforeDraw();
      ++this.drawn;
      return this.drawing(1);
    });
  }

  invalidate(): void {
    // A headset draws at its own beat, and the page's stands still.
    if (this.scheduled || this.ended || this.headset !== null) return;
    if (this.painting) {
      this.again = true;
      return;
    }
    this.scheduled = true;
    requestAnimationFrame((now) => {
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
    return this.grid && this.surface.frame !== null && !this.isRigView;
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
    for (const shown of this.surfaces) {
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
    for (const [i, { id }] of this.besides.entries()) poses[id] = this.isRigView ? null : (this.poses[i + 1] ?? kNowhere);
    camera.updateMatrixWorld();
    return {
      ...size,
      ratio: Math.min(window.devicePixelRatio, 2) * scale,
      world: camera.matrixWorld.toArray(),
      projection: camera.projectionMatrix.toArray(),
      mode: this.mode_,
      lens: this.isRigView ? rigCamera : null,
      range: this.range,
      ground: this.showsGround ? this.ground.ranges : null,
      poses,
      dimmed: this.besides.flatMap(({ id, word }) => (word === '' ? [] : [id])),
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
    const drawing = this.drawing(scale, !document.hidden && !this.isFilmed);
    this.painting = true;
    this.timing ||= drawing.timed;
    this.painter.draw(drawing);
    ++this.drawn;
    this.overlay.draw((point) => this.navigator.toPage(point), this.labels);
    window.clearTimeout(this.stillTimer);
    this.stillTimer = 0;
    if (scale === 1) return;
    this.stillTimer = window.setTimeout(() => {
      this.stillTimer = 0;
      if (this.painting) this.again = true;
      else if (this.headset === null) this.render(1);
    }, kStill_ms);
  }

  private get labels(): readonly Label[] {
    const ground = this.showsGround ? this.ground.labels : [];
    if (this.besides.length === 0 || this.navigator.isRigView) return ground;
    const names = [this.name, ...this.besides.map(({ name, word }) => text.streams.withWord(name, word))];
    const above = this.extents.flatMap((extent, i): Label[] => {
      if (extent === null) return [];
      const { min, max } = extent;
      const at: Label['at'] = [(min[0] + max[0]) / 2, min[1] - 0.1 * (max[1] - min[1]), (min[2] + max[2]) / 2];
      return [{ at: moved(this.poses[i]!, at), text: names[i]!, colour: '--text' }];
    });
    return [...above, ...ground]; // the first ones have their place
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.canvas;
    if (clientWidth === 0 || clientHeight === 0 || this.headset !== null) return;
    if (clientWidth === this.navigator.size.width && clientHeight === this.navigator.size.height) return;
    this.navigator.resize({ width: clientWidth, height: clientHeight });
  }
}
