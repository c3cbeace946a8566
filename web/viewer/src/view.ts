// SPDX-License-Identifier: Apache-2.0
// The picture: scene, surface, what is drawn over it. Draws only when something changed.
import * as THREE from 'three';
import type { Display, Mode, Way } from './display';
import { Ground, type Label } from './ground';
import { SurfaceMesh } from './mesh';
import type { DecodedFrame } from './messages';
import { Navigator } from './navigator';
import { Overlay } from './overlay';
import { steadyRange, type Range } from './palette';
import { pick, type Picked } from './pick';
import { around, placed, type Placement } from './placement';
import { readPixels, type PixelReport } from './pixels';
import type { Pinhole } from './protocol';
import { Resolution, drawnInSoftware } from './resolution';
import type { Extent } from './surface';

const kStill_ms = 1000; // without a drawing: the picture stands still and can be as fine as the screen
const kPoll_ms = 2;

/** A surface beside the first one, in a frame of its own camera. */
export interface Beside {
  readonly name: string;
  readonly mesh: SurfaceMesh;
  extent: Extent | null; // of its first frame
}

/** A place of one of the surfaces, in the frame of its own camera. */
export interface Hit extends Picked {
  readonly stream: string;
  readonly surface: DecodedFrame;
  readonly right: number; // metres from that frame to the scene's
}

export interface ViewEvents {
  /** Called right before a drawing; may call show(). */
  beforeDraw(): void;
  contextLost(lost: boolean): void;
  /** A person's hand left the rig's camera. */
  way(way: Way): void;
}

export class View {
  readonly navigator: Navigator;
  readonly overlay: Overlay;
  /** The processor draws, the rest of the page too. */
  readonly inSoftware = drawnInSoftware();
  private readonly sizes = new ResizeObserver(() => this.resize());
  private ended = false;
  private readonly renderer: THREE.WebGLRenderer;
  private readonly scene = new THREE.Scene();
  private readonly surface = new SurfaceMesh();
  private readonly ground = new Ground();
  private readonly besides: Beside[] = [];
  private placement_: Placement = 'beside';
  private extent: Extent | null = null; // of the first surface
  private offsets: number[] = [0]; // of the first surface and those beside it, metres to the right
  /** Of the first surface, where there are others beside it. */
  name = '';
  private scheduled = false;
  private readonly resolution = new Resolution();
  private scale = 0; // drawn at
  private fence: WebGLSync | null = null; // of a drawing that is being timed
  private stillTimer = 0;
  private range: Range | null = null;
  private grid = false;
  private readonly head = new THREE.PerspectiveCamera(); // of a person with a headset, who moves it
  private readonly lamp = new THREE.Group(); // with whoever looks
  drawn = 0;

  /** Throws where there is no WebGL 2. `overlay` lies over `canvas`; `keys`: where those are listened to that move. */
  constructor(
    readonly canvas: HTMLCanvasElement,
    overlay: HTMLCanvasElement,
    private readonly events: ViewEvents,
    keys: EventTarget = window,
  ) {
    // Four samples a pixel cost a processor that draws more than all the rest.
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !this.inSoftware, alpha: true });
    this.renderer.setClearAlpha(0);
    this.overlay = new Overlay(overlay);
    const navigated = { changed: () => this.invalidate(), way: (way: Way) => events.way(way) };
    this.navigator = new Navigator(canvas, navigated, keys);
    this.setScale(1);
    this.scene.add(this.surface.object, this.ground.object, this.navigator.camera);
    this.light();
    canvas.addEventListener('webglcontextlost', () => events.contextLost(true));
    canvas.addEventListener('webglcontextrestored', () => {
      events.contextLost(false);
      this.invalidate();
    });
    this.sizes.observe(canvas);
    this.resize();
  }

  set display(display: Display) {
    for (const mesh of this.meshes) mesh.mode = display.mode;
    this.grid = display.grid;
    if (this.navigator.way !== display.way) this.navigator.way = display.way;
    if (this.navigator.wantedFieldOfView !== display.fov) this.navigator.wantedFieldOfView = display.fov;
    this.invalidate();
  }
  get mode(): Mode {
    return this.surface.mode;
  }
  get wants(): { normals: boolean; edges: boolean; quality: boolean } {
    return this.surface.wants;
  }
  get shown(): DecodedFrame | null {
    return this.surface.shown;
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

  show(frame: DecodedFrame): void {
    this.surface.show(frame);
    if (frame.extent === null) return;
    const isFirst = this.extent === null;
    this.extent = frame.extent;
    if (isFirst && this.besides.length > 0) this.arrange();
    this.useExtent();
  }

  /** The surface of another stream; what it shows comes by showBeside(). */
  addBeside(name: string): Beside {
    const beside: Beside = { name, mesh: new SurfaceMesh(), extent: null };
    beside.mesh.mode = this.mode;
    beside.mesh.setPixelRatio(this.pixelRatio);
    this.besides.push(beside);
    this.scene.add(beside.mesh.object);
    return beside;
  }

  removeBeside(beside: Beside): void {
    this.besides.splice(this.besides.indexOf(beside), 1);
    this.scene.remove(beside.mesh.object);
    beside.mesh.dispose();
    this.arrange();
  }

  /** It gets its place by its first frame, and keeps it. */
  showBeside(beside: Beside, frame: DecodedFrame): void {
    beside.mesh.show(frame);
    if (this.range !== null) beside.mesh.setDepthRange(this.range);
    if (beside.extent !== null || frame.extent === null) return;
    beside.extent = frame.extent;
    this.arrange();
  }

  set placement(placement: Placement) {
    if (placement === this.placement_) return;
    this.placement_ = placement;
    this.arrange();
  }

  /** Where the surfaces stand: metres to the right of their cameras' frames, by name; none where there is only one. */
  get places(): Record<string, number> {
    return Object.fromEntries(this.besides.map(({ name }, i) => [name, this.offsets[i + 1] ?? 0]));
  }

  private get meshes(): SurfaceMesh[] {
    return [this.surface, ...this.besides.map(({ mesh }) => mesh)];
  }
  private get names(): string[] {
    return [this.name, ...this.besides.map(({ name }) => name)];
  }
  private get extents(): (Extent | null)[] {
    return [this.extent, ...this.besides.map(({ extent }) => extent)];
  }

  private arrange(): void {
    this.offsets = placed(this.extents, this.placement_);
    for (const [i, { mesh }] of this.besides.entries()) mesh.object.position.x = this.offsets[i + 1]!;
    this.useExtent();
    this.navigator.reset();
  }

  private useExtent(): void {
    const all = this.besides.length === 0 ? this.extent : around(this.extents, this.offsets);
    if (all === null) return;
    this.ground.setExtent(all);
    this.range = steadyRange(all.min[2], all.max[2], this.range);
    for (const mesh of this.meshes) mesh.setDepthRange(this.range);
    this.navigator.setExtent(all);
  }

  /** What is at this place of the page (pixels of it, from the canvas' upper left corner): the first of all surfaces. */
  pick(at: { x: number; y: number }): Hit | null {
    const ray = this.navigator.ray(at);
    if (ray === null) return null;
    let first: Hit | null = null;
    for (const [i, { shown: surface }] of this.meshes.entries()) {
      const stream = this.names[i]!;
      const right = this.rightOf(stream);
      if (surface === null || right === null) continue;
      const [x, y, z] = ray.origin;
      const picked = pick(surface, [x - right, y, z], ray.direction);
      if (picked !== null && (first === null || picked.along < first.along)) first = { ...picked, stream, surface, right };
    }
    return first;
  }

  /** How far a stream's surface stands to the right of its camera's frame, metres; null: it is not to be seen. */
  rightOf(stream: string): number | null {
    const i = this.names.indexOf(stream);
    return i < 0 || (i > 0 && this.isRigView) ? null : (this.offsets[i] ?? 0);
  }

  /** Whether there is none beside the first. */
  get isAlone(): boolean {
    return this.besides.length === 0;
  }

  /** Whether all surfaces stand in one camera's frame, so that lengths between them are true. */
  get isTogether(): boolean {
    return this.placement_ === 'together';
  }

  /** For good: gives back what it holds of the card. */
  end(): void {
    this.ended = true;
    this.sizes.disconnect();
    window.clearTimeout(this.stillTimer);
    this.navigator.end();
    for (const mesh of this.meshes) mesh.dispose();
    this.renderer.dispose();
  }

  /** Draws for a headset until its session ends. Its origin, where the person is now, is the rig's camera. */
  async immerse(session: XRSession): Promise<void> {
    const { xr } = this.renderer;
    session.addEventListener('end', () => {
      this.renderer.setAnimationLoop(null);
      xr.enabled = false;
      this.navigator.camera.add(this.lamp);
      this.resize();
      this.invalidate();
    });
    xr.enabled = true;
    xr.setReferenceSpaceType('local');
    await xr.setSession(session);
    this.head.add(this.lamp);
    this.scene.add(this.head);
    this.renderer.setAnimationLoop(() => {
      if (this.ended || !xr.isPresenting) return;
      this.events.beforeDraw();
      this.draw();
      ++this.drawn;
    });
  }

  invalidate(): void {
    // A headset draws at its own beat, and the page's stands still.
    if (this.scheduled || this.ended || this.renderer.xr.isPresenting) return;
    this.scheduled = true;
    requestAnimationFrame((now) => {
      if (!this.ended) this.events.beforeDraw();
      this.scheduled = false; // what changed until here is drawn now, not once more
      if (this.ended) return;
      this.navigator.update(now);
      this.setScale(this.resolution.scale);
      this.render();
      this.time();
    });
  }

  /** Whether something will be drawn without anything happening before: motion that dies away, a finer picture. */
  get isBusy(): boolean {
    return this.scheduled || this.fence !== null || this.stillTimer !== 0;
  }

  /** Of the screen's pixels that are drawn while the picture moves. */
  get movingScale(): number {
    return this.resolution.scale;
  }

  /** What is on the screen, for tests and for reports of people whose picture is wrong. */
  readPixels(): PixelReport {
    return readPixels(this.still());
  }

  /** Drawn now, as fine as the screen; to be read before anything else happens. */
  still(): WebGL2RenderingContext {
    this.setScale(1); // what is seen does not depend on how quickly it was drawn
    this.draw();
    return this.renderer.getContext() as WebGL2RenderingContext;
  }

  /** Behind the surface, where the page cannot show through; null: nothing. */
  set background(colour: THREE.ColorRepresentation | null) {
    this.scene.background = colour === null ? null : new THREE.Color(colour);
    this.invalidate();
  }

  // The rig's camera sees none.
  private get showsGround(): boolean {
    return this.grid && this.surface.shown !== null && !this.isRigView;
  }

  private get isRigView(): boolean {
    return this.navigator.isRigView && !this.renderer.xr.isPresenting;
  }

  private draw(): void {
    this.ground.object.visible = this.showsGround;
    // Another rig's camera sees something else.
    for (const { mesh } of this.besides) mesh.object.visible = !this.isRigView;
    this.surface.setLens(this.isRigView ? this.navigator.rigCamera : null);
    this.renderer.render(this.scene, this.renderer.xr.isPresenting ? this.head : this.navigator.camera);
  }

  private render(): void {
    this.draw();
    ++this.drawn;
    this.overlay.draw((point) => this.navigator.toPage(point), this.labels);
    window.clearTimeout(this.stillTimer);
    this.stillTimer = 0;
    if (this.scale === 1) return;
    this.stillTimer = window.setTimeout(() => {
      this.stillTimer = 0;
      this.setScale(1);
      this.render();
    }, kStill_ms);
  }

  private get labels(): readonly Label[] {
    const ground = this.showsGround ? this.ground.labels : [];
    if (this.besides.length === 0 || this.navigator.isRigView) return ground;
    const { names } = this;
    const above = this.extents.flatMap((extent, i): Label[] => {
      if (extent === null) return [];
      const { min, max } = extent;
      const at: Label['at'] = [(min[0] + max[0]) / 2 + this.offsets[i]!, min[1] - 0.1 * (max[1] - min[1]), (min[2] + max[2]) / 2];
      return [{ at, text: names[i]!, colour: '--text' }];
    });
    return [...above, ...ground]; // the first ones have their place
  }

  private get pixelRatio(): number {
    return Math.min(window.devicePixelRatio, 2) * this.scale;
  }

  private setScale(scale: number): void {
    if (scale === this.scale) return;
    this.scale = scale;
    this.renderer.setPixelRatio(this.pixelRatio);
    for (const mesh of this.meshes) mesh.setPixelRatio(this.pixelRatio);
  }

  // How long the graphics card, or the processor in its place, takes for what was just asked of it.
  private time(): void {
    if (this.fence !== null || document.hidden) return;
    const gl = this.renderer.getContext() as WebGL2RenderingContext;
    this.fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    if (this.fence === null) return; // the context is lost
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
      if (status === gl.SIGNALED) this.resolution.took(performance.now() - start);
    };
    window.setTimeout(poll, kPoll_ms);
  }

  private light(): void {
    this.scene.add(new THREE.HemisphereLight(0xdce7ff, 0x4a4038, 1.1));
    // A key light over the viewer's left shoulder, so that relief reads from every side.
    const key = new THREE.DirectionalLight(0xfff3e2, 2.1);
    key.position.set(-0.9, 1.1, 0.6);
    key.target.position.set(0, 0, -1);
    this.lamp.add(key, key.target);
    this.navigator.camera.add(this.lamp);
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.canvas;
    if (clientWidth === 0 || clientHeight === 0 || this.renderer.xr.isPresenting) return;
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.navigator.resize({ width: clientWidth, height: clientHeight });
  }
}
