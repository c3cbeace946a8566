// SPDX-License-Identifier: Apache-2.0
// From where the surface is seen, and how a person moves there: around a pivot, flying, or as the rig's camera.
import * as THREE from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import { kFov, type Way } from './display';
import { windowOf } from './dom';
import { Fly } from './fly';
import { freeOf, kClear, kNoInsets, viewOffset, type Insets } from './insets';
import type { Vec3 } from './pick';
import type { Pinhole } from './protocol';
import { lensOf, pictureRectangle, rigFrustum, rigRay, type Rectangle, type Size } from './rigCamera';
import { firstView, Framing } from './firstView';
import { distortPoint } from './lens';
import type { Extent } from './surface';

const kDefaultFov = 40;

/** A view, in three's frame (y up, z towards the viewer), as a link carries it. */
export interface Pose {
  position: Vec3;
  target: Vec3;
}

const kRestPerMs = 6e-6; // of the distance, or radians: less is not seen
const kDampingMs = 180; // in which all but a third of a motion that is left is done
const kUsualMs = 1000 / 60; // between drawings
const kJitter = 24; // pixels of the page: so much they may change before the view follows

export interface NavigatorEvents {
  changed(): void;
  /** Moving by hand leaves the rig's camera. */
  way(way: Way): void;
}

/** `wanted`, or `before` where that is nearly the same; `most`: pixels that more may lie over the view. */
function follow(before: Insets, wanted: Insets, most: number): Insets {
  const moved = [wanted.top - before.top, wanted.right - before.right, wanted.bottom - before.bottom, wanted.left - before.left];
  return moved.every((by) => by > -kJitter && by < most) ? before : wanted;
}

export class Navigator {
  readonly camera = new THREE.PerspectiveCamera(kDefaultFov, 1, 0.01, 100);
  private readonly controls: OrbitControls;
  private readonly fly: Fly;
  private rig: Pinhole | null = null;
  private extent: Extent | null = null;
  private readonly framing = new Framing();
  size: Readonly<Size> = { width: 1, height: 1 }; // of what is seen, pixels of the page
  // What the view heeds of what lies over it: the page's parts, and they with the panel that is open; else both the same.
  private heeded = { parts: kNoInsets, withPanel: kNoInsets };
  private said = this.heeded; // of them, last, however little it changed
  private insets = kNoInsets; // one of them
  private ignoresPanels_ = false;
  private way_: Way = 'orbit';
  private fov_ = 0;
  private placed = false; // the first view is set
  private moved = false; // by a person, since
  private placing = false; // the view is being set, by no hand
  private held = false; // by a person, who drags
  private moving = false; // at the last update
  private updated = 0; // when that was
  private readonly calm: MediaQueryList; // nothing is to move by itself

  constructor(
    canvas: HTMLCanvasElement,
    private readonly events: NavigatorEvents,
    keys: EventTarget,
  ) {
    this.calm = windowOf(canvas).matchMedia('(prefers-reduced-motion: reduce)');
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = true;
    this.controls.zoomToCursor = true;
    const changed = (): void => {
      if (this.isRigView && !this.placing && this.hasLeftRig) this.byHand();
      events.changed();
    };
    this.controls.addEventListener('change', changed);
    this.controls.addEventListener('start', () => {
      this.moved = true; // a mere click leaves no camera
      this.held = true;
    });
    this.controls.addEventListener('end', () => {
      this.held = false;
      changed();
    });
    // The controls tell of no step below a milliradian or a millimetre, and some take of a drag's last step no more at first.
    canvas.addEventListener('pointermove', () => {
      if (this.held) changed();
    });
    const flown = {
      look: (right: number, up: number) => this.way_ === 'fly' && this.look(right, up),
      moving: () => events.changed(),
    };
    this.fly = new Fly(canvas, flown, keys);
  }

  /** For good. */
  end(): void {
    this.controls.dispose();
    this.fly.end();
  }

  get way(): Way {
    return this.way_;
  }

  /** The camera's way needs a rig and falls back to orbiting without. */
  set way(way: Way) {
    const before = this.way_;
    this.way_ = way;
    this.controls.enableRotate = way !== 'fly';
    this.controls.enableZoom = this.controls.enablePan = true;
    if (way === 'camera') {
      this.enterRig();
      this.setInsets(this.said.parts, this.said.withPanel); // which that view heeds more closely
    } else if (before === 'camera') {
      this.project();
    }
    this.events.changed();
  }

  /** What is really shown: the rig's camera may not be known yet. */
  get isRigView(): boolean {
    return this.way_ === 'camera' && this.rig !== null;
  }

  get rigCamera(): Pinhole | null {
    return this.rig;
  }

  /** Degrees; 0: the rig camera's. */
  set wantedFieldOfView(degrees: number) {
    this.fov_ = degrees;
    if (!this.placed) return;
    this.camera.fov = this.wantedFov();
    this.project();
    this.events.changed();
  }
  get wantedFieldOfView(): number {
    return this.fov_;
  }

  /** The rig of the stream; the next surface sets the view, unless the view is to be kept. */
  restart(rig: Pinhole | null, keep: boolean): void {
    this.rig = rig;
    if (!keep) this.placed = false;
    if (this.way_ === 'camera') this.enterRig();
    else this.project();
  }

  setExtent(extent: Extent): void {
    this.extent = extent;
    if (!this.placed) this.reset();
  }

  resize(size: Size): void {
    this.size = size;
    this.camera.aspect = size.width / size.height;
    this.project();
    if (this.placed && !this.moved) this.setFirstView();
    this.events.changed();
  }

  /**
   * Of the page's own parts, and with the panel that is open, where there is one; else both the same. The middle of what
   * they leave free is what is turned around, and the first view lies within.
   */
  setInsets(parts: Insets, withPanel: Insets): void {
    this.said = { parts, withPanel };
    const most = this.isRigView ? kClear : kJitter; // its picture is to be whole
    const heeded = follow(this.heeded.parts, parts, most);
    this.heeded = { parts: heeded, withPanel: parts === withPanel ? heeded : follow(this.heeded.withPanel, withPanel, most) };
    this.heed();
  }

  /** While what is seen is recorded: panels that open and close do not move it. */
  set ignoresPanels(ignores: boolean) {
    this.ignoresPanels_ = ignores;
    this.heed();
  }

  private heed(): void {
    const wanted = this.ignoresPanels_ ? this.heeded.parts : this.heeded.withPanel;
    if (wanted === this.insets) return;
    this.insets = wanted;
    this.resize(this.size);
  }

  /** The projection as it is while no panel is open. */
  get bareProjection(): number[] {
    if (this.insets === this.heeded.parts) return this.camera.projectionMatrix.toArray();
    const camera = this.camera.clone();
    this.project(camera, this.heeded.parts);
    return camera.projectionMatrix.toArray();
  }

  /** Where on the page the picture of the rig's camera lies, while that is what is seen. */
  get picture(): Rectangle | null {
    return this.isRigView ? pictureRectangle(this.rig!, this.size, this.insets) : null;
  }

  /** Back to the first view, of the surface as it is now. */
  reset(): void {
    if (this.extent === null) return;
    this.framing.choose(this.extent);
    this.setFirstView();
  }

  private setFirstView(): void {
    if (this.extent === null) return;
    this.placed = true;
    this.moved = false;
    this.placing = true;
    this.stopMotion();
    this.camera.fov = this.wantedFov();
    const tangent = Math.tan(THREE.MathUtils.degToRad(this.camera.fov) / 2); // of half the page's height
    const { width, height } = freeOf(this.size, this.insets);
    const framed = this.framing.frame(this.extent);
    const view = firstView(framed, (tangent * width) / this.size.height, (tangent * height) / this.size.height);
    this.limits(view.distance);
    this.controls.target.set(...view.target);
    this.camera.position.set(...view.position);
    if (this.way_ === 'camera') this.enterRig();
    this.project();
    this.controls.update();
    this.placing = false;
    this.events.changed();
  }

  /** Radians around the target. */
  orbit(right: number, up: number): void {
    if (this.way_ === 'fly') return this.look(-right, -up);
    const spherical = this.fromTarget();
    spherical.theta += right;
    spherical.phi = THREE.MathUtils.clamp(spherical.phi - up, 0.05, Math.PI - 0.05);
    this.place(spherical);
  }

  /** Shares of the distance. */
  pan(right: number, up: number, ahead = 0): void {
    const scale = this.camera.position.distanceTo(this.controls.target);
    const move = new THREE.Vector3(right * scale, up * scale, -ahead * scale).applyQuaternion(this.camera.quaternion);
    this.byHand();
    this.controls.target.add(move);
    this.camera.position.add(move);
    this.controls.update();
    this.events.changed();
  }

  zoom(factor: number): void {
    const spherical = this.fromTarget();
    const { minDistance, maxDistance } = this.controls;
    spherical.radius = THREE.MathUtils.clamp(spherical.radius / factor, minDistance, maxDistance);
    this.place(spherical);
  }

  /** Turns around this place of the surface (rig frame) from now on, and brings it to the middle. */
  setPivot([x, y, z]: Vec3): void {
    this.byHand();
    this.stopMotion();
    const target = new THREE.Vector3(x, -y, -z);
    this.camera.position.add(target.clone().sub(this.controls.target));
    this.controls.target.copy(target);
    this.controls.update();
    this.events.changed();
  }

  get pose(): Pose {
    return { position: this.camera.position.toArray(), target: this.controls.target.toArray() };
  }

  set pose({ position, target }: Pose) {
    this.stopMotion();
    this.placed = this.moved = true;
    this.camera.fov = this.wantedFov();
    this.camera.position.set(...position);
    this.controls.target.set(...target);
    this.limits(this.camera.position.distanceTo(this.controls.target));
    this.project();
    this.controls.update();
    this.events.changed();
  }

  /** Right before a drawing; asks for the next one while the motion dies away or a key moves. */
  update(now: number): void {
    const step = this.fly.step(now);
    if (step !== null) this.pan(...step);
    const { position, quaternion } = this.camera;
    const [place, gaze] = [position.clone(), quaternion.clone()];
    // The controls' damping is of each drawing, and drawings may be a second apart.
    const since = this.moving ? Math.max(now - this.updated, 1) : kUsualMs;
    this.controls.dampingFactor = this.calm.matches ? 1 : 1 - Math.exp(-since / kDampingMs);
    this.controls.update();
    // Many steps of which the controls do not tell are left of a drag.
    const moved = position.distanceTo(place) / position.distanceTo(this.controls.target) + quaternion.angleTo(gaze);
    this.moving = moved > kRestPerMs * since;
    this.updated = now;
    if (this.moving) this.events.changed();
    if (this.isRigView) this.projectRig();
  }

  /** The ray through a place on the page, in the rig camera's frame. */
  ray(at: { x: number; y: number }): { origin: Vec3; direction: Vec3 } | null {
    if (this.isRigView) {
      const direction = rigRay(this.rig!, this.size, this.insets, at);
      return direction === null ? null : { origin: [0, 0, 0], direction };
    }
    const ndc = new THREE.Vector3((at.x / this.size.width) * 2 - 1, 1 - (at.y / this.size.height) * 2, 0.5);
    this.camera.updateMatrixWorld();
    const { x: ox, y: oy, z: oz } = this.camera.position;
    const far = ndc.unproject(this.camera).sub(this.camera.position).normalize();
    return { origin: [ox, -oy, -oz], direction: [far.x, -far.y, -far.z] };
  }

  /** Where a point of the rig camera's frame is on the page; null behind the viewer. */
  toPage([x, y, z]: Vec3): { x: number; y: number } | null {
    const at = this.isRigView ? distortPoint(lensOf(this.rig!), [x, y, z]) : [x, y, z];
    const point = new THREE.Vector3(at[0], -at[1]!, -at[2]!).applyMatrix4(this.camera.matrixWorldInverse);
    if (point.z > -1e-6) return null;
    point.applyMatrix4(this.camera.projectionMatrix);
    return { x: ((point.x + 1) / 2) * this.size.width, y: ((1 - point.y) / 2) * this.size.height };
  }

  /** Of what nothing lies over, on the page. */
  get middle(): { x: number; y: number } {
    return freeOf(this.size, this.insets);
  }

  private enterRig(): void {
    if (this.rig === null) return;
    this.placing = true;
    this.stopMotion();
    this.camera.position.set(0, 0, 0);
    this.controls.target.set(0, 0, -(this.extent?.centre[2] ?? 1)); // around which turning by hand begins
    this.controls.minDistance = 0;
    this.controls.update();
    this.placing = false;
    this.projectRig();
  }

  private get hasLeftRig(): boolean {
    return this.camera.position.lengthSq() > 1e-10 || Math.abs(this.camera.quaternion.w) < 1 - 1e-9;
  }

  private projectRig(camera = this.camera, insets = this.insets): void {
    const { left, right, top, bottom } = rigFrustum(this.rig!, this.size, insets);
    const near = (this.extent?.min[2] ?? 1) / 50;
    const far = near * 5000;
    camera.near = near;
    camera.far = far;
    camera.projectionMatrix.makePerspective(left * near, right * near, top * near, bottom * near, near, far);
    camera.projectionMatrixInverse.copy(camera.projectionMatrix).invert();
  }

  private project(camera = this.camera, insets = this.insets): void {
    if (this.isRigView) return this.projectRig(camera, insets);
    camera.setViewOffset(...viewOffset(this.size, insets)); // and the matrix
  }

  private limits(distance: number): void {
    this.camera.near = distance / 100;
    this.camera.far = distance * 60;
    this.controls.minDistance = distance / 20;
    this.controls.maxDistance = distance * 8;
  }

  private wantedFov(): number {
    if (this.fov_ > 0) return THREE.MathUtils.clamp(this.fov_, kFov.least, kFov.most);
    const fov = this.rig ? 2 * Math.atan(this.rig.height / 2 / this.rig.fy) : 0;
    return fov > 0 ? THREE.MathUtils.clamp(THREE.MathUtils.radToDeg(fov), 20, 60) : kDefaultFov;
  }

  private byHand(): void {
    this.moved = true;
    if (this.way_ !== 'camera') return;
    this.camera.fov = this.rig ? THREE.MathUtils.radToDeg(2 * Math.atan(this.rig.height / 2 / this.rig.fy)) : this.camera.fov;
    this.way = 'orbit';
    this.events.way('orbit');
  }

  private look(right: number, up: number): void {
    this.byHand();
    const ahead = this.controls.target.clone().sub(this.camera.position);
    const spherical = new THREE.Spherical().setFromVector3(ahead);
    spherical.theta -= right;
    spherical.phi = THREE.MathUtils.clamp(spherical.phi - up, 0.05, Math.PI - 0.05);
    this.controls.target.setFromSpherical(spherical).add(this.camera.position);
    this.controls.update();
    this.events.changed();
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
    this.byHand();
    this.camera.position.setFromSpherical(spherical).add(this.controls.target);
    this.controls.update();
    this.events.changed();
  }
}
