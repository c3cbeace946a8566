// SPDX-License-Identifier: Apache-2.0
// The picture: scene, camera, how a person moves it. Draws only when something changed.
import * as THREE from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import { SurfaceMesh, type Mode } from './mesh';
import type { DecodedFrame } from './messages';
import type { Pinhole } from './protocol';
import { Resolution, drawnInSoftware } from './resolution';
import type { Extent } from './surface';

// From where the surface is first seen: the rig's own camera, moved aside and up far enough that relief reads.
const kAzimuth = THREE.MathUtils.degToRad(16);
const kElevation = THREE.MathUtils.degToRad(13);
const kMargin = 1.2;
const kDefaultFov = 40;
const kStill_ms = 1000; // without a drawing: the picture stands still and can be as fine as the screen
const kPoll_ms = 2;

export interface ViewEvents {
  /** Called right before a drawing; may call show(). */
  beforeDraw(): void;
  contextLost(lost: boolean): void;
}

export interface PixelReport {
  width: number;
  height: number;
  covered: number; // share of the pixels that the surface covers
  mean: number; // brightness of those, 0..255
  deviation: number;
  hash: number;
}

export class View {
  private readonly renderer: THREE.WebGLRenderer;
  private readonly scene = new THREE.Scene();
  private readonly camera = new THREE.PerspectiveCamera(kDefaultFov, 1, 0.01, 100);
  private readonly controls: OrbitControls;
  private readonly surface: SurfaceMesh;
  private scheduled = false;
  private readonly resolution = new Resolution();
  private scale = 0; // drawn at
  private fence: WebGLSync | null = null; // of a drawing that is being timed
  private stillTimer = 0;
  private extent: Extent | null = null;
  private placed = false; // the first view is set
  private moved = false; // by a person, since
  private rigCamera: Pinhole | null = null;
  drawn = 0;

  /** Throws where there is no WebGL 2. */
  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly events: ViewEvents,
  ) {
    // Four samples a pixel cost a processor that draws more than all the rest.
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !drawnInSoftware(), alpha: true });
    this.renderer.setClearAlpha(0);
    this.surface = new SurfaceMesh();
    this.setScale(1);
    this.scene.add(this.surface.object, this.camera);
    this.light();

    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = true;
    this.controls.dampingFactor = 0.09;
    this.controls.zoomToCursor = true;
    this.controls.addEventListener('change', () => this.invalidate());
    this.controls.addEventListener('start', () => (this.moved = true));
    canvas.addEventListener('dblclick', () => this.reset());
    canvas.addEventListener('webglcontextlost', () => events.contextLost(true));
    canvas.addEventListener('webglcontextrestored', () => {
      events.contextLost(false);
      this.invalidate();
    });
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
  }

  get mode(): Mode {
    return this.surface.mode;
  }
  set mode(mode: Mode) {
    this.surface.mode = mode;
    this.invalidate();
  }
  get wants(): { normals: boolean; edges: boolean; quality: boolean } {
    return this.surface.wants;
  }

  /** The rig of the stream; the next surface sets the view, unless the view is to be kept. */
  restart(camera: Pinhole, keep: boolean): void {
    this.rigCamera = camera;
    if (!keep) this.placed = false;
  }

  show(frame: DecodedFrame): void {
    this.surface.show(frame);
    if (frame.extent === null) return;
    this.extent = frame.extent;
    if (!this.placed) this.reset();
  }

  /** Back to the first view, of the surface as it is now. */
  reset(): void {
    const e = this.extent;
    if (e === null) return;
    this.placed = true;
    this.moved = false;
    this.stopMotion();
    const fov = this.rigCamera ? 2 * Math.atan(this.rigCamera.height / 2 / this.rigCamera.fy) : 0;
    this.camera.fov = fov > 0 ? THREE.MathUtils.clamp(THREE.MathUtils.radToDeg(fov), 20, 60) : kDefaultFov;
    const tangent = Math.tan(THREE.MathUtils.degToRad(this.camera.fov) / 2);
    const half = [0, 1, 2].map((i) => (e.max[i]! - e.min[i]!) / 2) as [number, number, number];
    const middle = [0, 1, 2].map((i) => (e.max[i]! + e.min[i]!) / 2) as [number, number, number];
    const width = half[0] * Math.cos(kAzimuth) + half[2] * Math.sin(kAzimuth);
    const height = half[1] * Math.cos(kElevation) + half[2] * Math.sin(kElevation);
    const distance = kMargin * Math.max(height / tangent, width / (tangent * this.camera.aspect)) + half[2] * 0.5;
    this.camera.near = distance / 100;
    this.camera.far = distance * 60;
    this.camera.updateProjectionMatrix();
    this.controls.minDistance = distance / 20;
    this.controls.maxDistance = distance * 8;
    this.controls.target.set(middle[0], -middle[1], -middle[2]);
    this.camera.position
      .setFromSphericalCoords(distance, Math.PI / 2 - kElevation, kAzimuth)
      .add(this.controls.target);
    this.controls.update();
    this.invalidate();
  }

  /** Radians around the target. */
  orbit(right: number, up: number): void {
    const spherical = this.fromTarget();
    spherical.theta += right;
    spherical.phi = THREE.MathUtils.clamp(spherical.phi - up, 0.05, Math.PI - 0.05);
    this.place(spherical);
  }

  /** Shares of the distance. */
  pan(right: number, up: number): void {
    const scale = this.camera.position.distanceTo(this.controls.target);
    const move = new THREE.Vector3(right * scale, up * scale, 0).applyQuaternion(this.camera.quaternion);
    this.controls.target.add(move);
    this.camera.position.add(move);
    this.moved = true;
    this.controls.update();
    this.invalidate();
  }

  zoom(factor: number): void {
    const spherical = this.fromTarget();
    spherical.radius = THREE.MathUtils.clamp(
      spherical.radius / factor,
      this.controls.minDistance,
      this.controls.maxDistance,
    );
    this.place(spherical);
  }

  invalidate(): void {
    if (this.scheduled) return;
    this.scheduled = true;
    requestAnimationFrame(() => {
      this.scheduled = false;
      this.events.beforeDraw();
      this.controls.update(); // schedules the next drawing while the motion dies away
      this.setScale(this.resolution.scale);
      this.render();
      this.time();
    });
  }

  /** Of the screen's pixels that are drawn while the picture moves. */
  get movingScale(): number {
    return this.resolution.scale;
  }

  /** What is on the screen, for tests and for reports of people whose picture is wrong. */
  readPixels(): PixelReport {
    this.setScale(1); // what is seen does not depend on how quickly it was drawn
    this.renderer.render(this.scene, this.camera);
    const gl = this.renderer.getContext();
    const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
    const pixels = new Uint8Array(width * height * 4);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    let [count, sum, squares, hash] = [0, 0, 0, 2166136261];
    for (let i = 0; i < pixels.length; i += 4) {
      if (pixels[i + 3]! < 128) continue;
      const value = (pixels[i]! + 2 * pixels[i + 1]! + pixels[i + 2]!) / 4;
      ++count;
      sum += value;
      squares += value * value;
      hash = Math.imul(hash ^ (i + value), 16777619) >>> 0;
    }
    const mean = count > 0 ? sum / count : 0;
    const deviation = count > 0 ? Math.sqrt(Math.max(0, squares / count - mean * mean)) : 0;
    return { width, height, covered: count / (width * height), mean, deviation, hash };
  }

  private render(): void {
    this.renderer.render(this.scene, this.camera);
    ++this.drawn;
    window.clearTimeout(this.stillTimer);
    if (this.scale === 1) return;
    this.stillTimer = window.setTimeout(() => {
      this.setScale(1);
      this.render();
    }, kStill_ms);
  }

  private setScale(scale: number): void {
    if (scale === this.scale) return;
    this.scale = scale;
    const pixelRatio = Math.min(window.devicePixelRatio, 2) * scale;
    this.renderer.setPixelRatio(pixelRatio);
    this.surface.setPixelRatio(pixelRatio);
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

  // What is left of a drag's momentum would carry the new view away.
  private stopMotion(): void {
    this.controls.enableDamping = false;
    this.controls.update();
    this.controls.enableDamping = true;
  }

  private fromTarget(): THREE.Spherical {
    return new THREE.Spherical().setFromVector3(this.camera.position.clone().sub(this.controls.target));
  }

  private place(spherical: THREE.Spherical): void {
    this.camera.position.setFromSpherical(spherical).add(this.controls.target);
    this.moved = true;
    this.controls.update();
    this.invalidate();
  }

  private light(): void {
    this.scene.add(new THREE.HemisphereLight(0xdce7ff, 0x4a4038, 1.1));
    // A key light over the viewer's left shoulder, so that relief reads from every side.
    const key = new THREE.DirectionalLight(0xfff3e2, 2.1);
    key.position.set(-0.9, 1.1, 0.6);
    key.target.position.set(0, 0, -1);
    this.camera.add(key, key.target);
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.canvas;
    if (clientWidth === 0 || clientHeight === 0) return;
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    this.camera.updateProjectionMatrix();
    if (this.placed && !this.moved) this.reset();
    this.invalidate();
  }
}
