// SPDX-License-Identifier: Apache-2.0
// The scene on the graphics card, drawn where it is made: on a worker's thread or the page's.
import * as THREE from 'three';
import type { Drawing, Drawn } from './drawing';
import { GroundLines } from './groundLines';
import { SurfaceMesh } from './mesh';
import { pixelsOf, type Pixels } from './pixels';

const kPoll_ms = 2;

export interface StageEvents {
  /** The graphics took this long for a drawing; null: it is not known. */
  took(ms: number | null): void;
  contextLost(lost: boolean): void;
}

export class Stage {
  private readonly renderer: THREE.WebGLRenderer;
  private readonly scene = new THREE.Scene();
  private readonly meshes = new Map<number, SurfaceMesh>();
  private readonly ground = new GroundLines();
  private readonly camera = new THREE.PerspectiveCamera();
  private readonly head = new THREE.PerspectiveCamera(); // of a person with a headset, who moves it
  private readonly lamp = new THREE.Group(); // with whoever looks
  private fence: WebGLSync | null = null; // of a drawing that is being timed
  private size = '';
  private background: string | null = null;

  /** Throws where there is no WebGL 2. */
  constructor(
    private readonly canvas: HTMLCanvasElement | OffscreenCanvas,
    private readonly antialias: boolean,
    private readonly events: StageEvents,
  ) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias, alpha: true });
    this.renderer.setClearAlpha(0);
    this.camera.matrixAutoUpdate = false;
    this.scene.add(this.ground.object, this.camera, this.head);
    this.light();
    canvas.addEventListener('webglcontextlost', () => {
      // Now that it costs nothing: given back later, it would be to a context that it is not of.
      for (const mesh of this.meshes.values()) mesh.dispose();
      events.contextLost(true);
    });
    canvas.addEventListener('webglcontextrestored', () => events.contextLost(false));
  }

  /** The picture is the caller's, and open until the next one is shown. */
  show(surface: number, frame: Drawn): void {
    let mesh = this.meshes.get(surface);
    if (mesh === undefined) {
      // WebKit's port for Linux, where workers have no WebGL, gives the card nothing of a picture that a worker made.
      mesh = new SurfaceMesh(this.antialias, 'ownerDocument' in this.canvas ? this.canvas.ownerDocument.createElement('canvas') : null);
      this.meshes.set(surface, mesh);
      this.scene.add(mesh.object);
    }
    mesh.show(frame);
  }

  remove(surface: number): void {
    const mesh = this.meshes.get(surface);
    if (mesh === undefined) return;
    this.meshes.delete(surface);
    this.scene.remove(mesh.object);
    mesh.dispose();
  }

  draw(drawing: Drawing): void {
    this.prepare(drawing);
    this.renderer.render(this.scene, this.renderer.xr.isPresenting ? this.head : this.camera);
    if (drawing.timed) this.time();
  }

  read(drawing: Drawing): Pixels {
    this.draw(drawing);
    return pixelsOf(this.renderer.getContext() as WebGL2RenderingContext);
  }

  /** Null: the browser could not. */
  png(drawing: Drawing): Promise<Blob | null> {
    this.draw(drawing);
    const { canvas } = this; // it has this very drawing
    // In Firefox both kinds of canvas have a toBlob, and that of workers never calls back.
    return 'convertToBlob' in canvas ? canvas.convertToBlob() : new Promise((resolve) => canvas.toBlob(resolve));
  }

  /** Draws for a headset until its session ends, at its own beat; its origin, where the person is now, is the rig's camera. */
  async immerse(session: XRSession, next: () => Drawing): Promise<void> {
    const { xr } = this.renderer;
    xr.enabled = true;
    xr.setReferenceSpaceType('local');
    await xr.setSession(session);
    this.head.add(this.lamp);
    this.renderer.setAnimationLoop(() => {
      if (xr.isPresenting) this.draw(next());
    });
  }

  /** For good: gives back what it holds of the card. */
  end(): void {
    this.renderer.setAnimationLoop(null);
    for (const mesh of this.meshes.values()) mesh.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss(); // else the browser keeps it until it collects
  }

  private prepare({ width, height, ratio, world, projection, mode, lens, range, ground, poses, dimmed, background, smooth }: Drawing): void {
    const size = [width, height, ratio].join();
    if (size !== this.size && !this.renderer.xr.isPresenting) {
      this.size = size;
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(width, height, false);
    }
    if (background !== this.background) {
      this.background = background;
      this.scene.background = background === null ? null : new THREE.Color(background);
    }
    this.camera.matrix.fromArray(world);
    this.camera.matrixWorldNeedsUpdate = true;
    this.camera.projectionMatrix.fromArray(projection);
    this.camera.projectionMatrixInverse.copy(this.camera.projectionMatrix).invert();
    this.ground.show(ground);
    for (const [surface, mesh] of this.meshes) {
      const pose = poses[surface] ?? null;
      mesh.object.visible = pose !== null;
      if (pose !== null) mesh.place(pose);
      mesh.mode = mode;
      mesh.smooth = smooth;
      mesh.dimmed = dimmed.includes(surface);
      mesh.setPixelRatio(ratio);
      mesh.setLens(surface === 0 ? lens : null);
      if (range !== null) mesh.setDepthRange(range);
    }
  }

  // How long the graphics card, or the processor in its place, takes for what was just asked of it.
  private time(): void {
    if (this.fence !== null) return;
    const gl = this.renderer.getContext() as WebGL2RenderingContext;
    this.fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    if (this.fence === null) return this.events.took(null); // the context is lost
    gl.flush();
    const start = performance.now();
    const poll = (): void => {
      const status = gl.getSyncParameter(this.fence!, gl.SYNC_STATUS) as number | null;
      if (status === gl.UNSIGNALED) {
        setTimeout(poll, kPoll_ms);
        return;
      }
      gl.deleteSync(this.fence);
      this.fence = null;
      this.events.took(status === gl.SIGNALED ? performance.now() - start : null);
    };
    setTimeout(poll, kPoll_ms);
  }

  private light(): void {
    this.scene.add(new THREE.HemisphereLight(0xdce7ff, 0x4a4038, 1.1));
    // A key light over the viewer's left shoulder, so that relief reads from every side.
    const key = new THREE.DirectionalLight(0xfff3e2, 2.1);
    key.position.set(-0.9, 1.1, 0.6);
    key.target.position.set(0, 0, -1);
    this.lamp.add(key, key.target);
    this.camera.add(this.lamp);
  }
}
