// SPDX-License-Identifier: Apache-2.0
// The surface on the graphics card. Buffers only grow, so that a mesh of changing size thirty times a second
// allocates nothing.
import * as THREE from 'three';
import { hasPicture, wantsOf, type Mode, type Wants } from './display';
import type { Drawn } from './drawing';
import { Materials } from './materials';
import type { Range } from './palette';
import type { Pinhole } from './protocol';
import { confidenceColours } from './quality';
import { kNowhere, type Rigid } from './rigid';
import { vertexRims } from './rims';
import { triangleEdges, vertexNormals } from './surface';

class Growing {
  attribute: THREE.BufferAttribute;

  constructor(
    private readonly make: (items: number) => THREE.BufferAttribute,
    readonly itemSize: number,
  ) {
    this.attribute = make(0);
  }

  /** True where a larger buffer took the place of the old one. */
  set(values: Float32Array | Uint32Array): boolean {
    const grown = values.length > this.attribute.array.length;
    if (grown) this.attribute = this.make(Math.ceil((values.length / this.itemSize) * 1.3));
    (this.attribute.array as Float32Array).set(values);
    this.attribute.clearUpdateRanges();
    this.attribute.addUpdateRange(0, values.length);
    this.attribute.needsUpdate = true;
    return grown;
  }
}

const floats = (size: number): Growing =>
  new Growing((items) => {
    const attribute = new THREE.BufferAttribute(new Float32Array(items * size), size);
    return attribute.setUsage(THREE.DynamicDrawUsage);
  }, size);
const indices = (): Growing =>
  new Growing((items) => {
    const attribute = new THREE.BufferAttribute(new Uint32Array(items), 1);
    return attribute.setUsage(THREE.DynamicDrawUsage);
  }, 1);

function copied(bitmap: ImageBitmap, onto: HTMLCanvasElement): HTMLCanvasElement {
  if (onto.width !== bitmap.width) onto.width = bitmap.width;
  if (onto.height !== bitmap.height) onto.height = bitmap.height;
  const context = onto.getContext('2d')!;
  context.globalCompositeOperation = 'copy';
  context.drawImage(bitmap, 0, 0);
  return onto;
}

export class SurfaceMesh {
  /** In a camera's frame (x right, y down, z forward), turned into three's (y up, z towards the viewer). */
  readonly object = new THREE.Group();
  private readonly position = floats(3);
  private readonly uv = floats(2);
  private readonly normal = floats(3);
  private readonly colour = floats(3); // of confidence
  private readonly rim = floats(1);
  private readonly triangle = indices();
  private readonly edge = indices();
  private readonly solid = new THREE.BufferGeometry();
  private readonly lines = new THREE.BufferGeometry();
  private readonly cloud = new THREE.BufferGeometry();
  private readonly texture = new THREE.Texture();
  private readonly materials: Materials;
  private readonly mesh: THREE.Mesh<THREE.BufferGeometry, THREE.Material>;
  private readonly wires: THREE.LineSegments;
  private readonly points: THREE.Points<THREE.BufferGeometry, THREE.Material>;
  private mode_: Mode = 'textured';
  private smooth_ = false;
  private vertices = 0;
  private triangleIndices = 0;
  private size = ''; // of the picture
  private textured = false; // the frame shown has a picture and coordinates
  private hasNormals = false;
  private hasEdges = false;
  private hasRims = false;
  private hasQuality = false;
  private hasColours = false;
  private frame: Drawn | null = null;

  /** `antialias`: the card takes several samples a pixel. `paper`: what pictures pass through; null: the card takes them as they come. */
  constructor(
    antialias: boolean,
    private readonly paper: HTMLCanvasElement | null,
  ) {
    this.materials = new Materials(this.texture, antialias);
    this.mesh = new THREE.Mesh(this.solid, this.materials.textured);
    this.wires = new THREE.LineSegments(this.lines, this.materials.wire);
    this.points = new THREE.Points(this.cloud, this.materials.points);
    this.object.matrixAutoUpdate = false;
    this.place(kNowhere);
    for (const part of [this.mesh, this.wires, this.points]) {
      part.frustumCulled = false; // bounds of a surface that changes all the time cost more than they save
      this.object.add(part);
    }
    // Texture row 0 is the picture's top and v = 0 means top (FORMAT.md): nothing is to be flipped.
    this.texture.flipY = false;
    this.texture.colorSpace = THREE.SRGBColorSpace;
    this.texture.generateMipmaps = false;
    this.texture.minFilter = this.texture.magFilter = THREE.LinearFilter;
    this.attach();
    this.apply();
  }

  /** Its camera's frame in the scene's. */
  place({ rotation: r, translation: [x, y, z] }: Rigid): void {
    const [a, b, c] = [r.slice(0, 3), r.slice(3, 6), r.slice(6, 9)] as [number[], number[], number[]];
    this.object.matrix.set(a[0]!, a[1]!, a[2]!, x, -b[0]!, -b[1]!, -b[2]!, -y, -c[0]!, -c[1]!, -c[2]!, -z, 0, 0, 0, 1);
    this.object.matrixWorldNeedsUpdate = true;
  }

  /** Drawn pixels to one of the page's. */
  setPixelRatio(ratio: number): void {
    this.materials.setPointSize(1.75 * ratio);
  }

  set mode(mode: Mode) {
    if (mode === this.mode_) return;
    this.mode_ = mode;
    this.derive();
    this.apply();
  }

  /** The lens whose distortion bends what is drawn; null: none. */
  setLens(camera: Pinhole | null): void {
    this.materials.setLens(camera);
  }

  /** Whether rims are drawn without the steps of their stripes, in modes that show a picture or relief. */
  set smooth(smooth: boolean) {
    if (smooth === this.smooth_) return;
    this.smooth_ = smooth;
    this.derive();
  }

  /** The ground shows through: it is not of now. */
  set dimmed(dimmed: boolean) {
    this.materials.dimmed = dimmed;
  }

  setDepthRange(range: Range): void {
    this.materials.setDepthRange(range);
  }

  /** The picture is the caller's, and open until the next one is shown. */
  show(frame: Drawn): void {
    let grown = this.position.set(frame.positions);
    grown = this.triangle.set(frame.triangles) || grown;
    if (frame.coordinates !== null) grown = this.uv.set(frame.coordinates) || grown;
    if (frame.normals !== null) grown = this.normal.set(frame.normals) || grown;
    if (frame.rims != null) grown = this.rim.set(frame.rims) || grown;
    if (frame.edges !== null) grown = this.edge.set(frame.edges) || grown;
    this.frame = frame;
    this.hasQuality = frame.quality !== null;
    this.hasColours = (frame.colours ?? null) !== null;
    grown = this.setColours() || grown;
    this.vertices = frame.positions.length / 3;
    this.triangleIndices = frame.triangles.length;
    this.hasNormals = frame.normals !== null;
    this.hasEdges = frame.edges !== null;
    this.hasRims = frame.rims != null;
    this.textured = hasPicture(frame);
    if (frame.texture !== null) this.setTexture(frame.texture);
    if (grown) this.attach();
    this.derive();
    this.apply();
  }

  /** Gives back what it holds of the card. */
  dispose(): void {
    for (const geometry of [this.solid, this.lines, this.cloud]) geometry.dispose();
    this.materials.dispose();
    this.texture.dispose();
  }

  private setTexture(bitmap: ImageBitmap): void {
    // The card's storage is of a fixed size.
    const size = `${bitmap.width}x${bitmap.height}`;
    if (size !== this.size) this.texture.dispose();
    this.size = size;
    this.texture.image = this.paper === null ? bitmap : copied(bitmap, this.paper);
    this.texture.needsUpdate = true;
  }

  // A frame that came before the mode was chosen lacks what the mode needs; on a stalled stream no other comes.
  private derive(): void {
    const triangles = (this.triangle.attribute.array as Uint32Array).subarray(0, this.triangleIndices);
    let grown = false;
    if (this.mode_ === 'wireframe' && !this.hasEdges) {
      grown = this.edge.set(triangleEdges(triangles)) || grown;
      this.hasEdges = true;
    }
    if (this.frame !== null && (this.mode_ === 'confidence' || this.hasColours)) grown = this.setColours();
    if (this.wants.normals && !this.hasNormals) {
      const positions = (this.position.attribute.array as Float32Array).subarray(0, this.vertices * 3);
      grown = this.normal.set(vertexNormals(positions, triangles)) || grown;
      this.hasNormals = true;
    }
    const { coordinates } = this.frame ?? { coordinates: null };
    const smooth = this.smooth_ && this.wants.rims && coordinates !== null;
    if (smooth && !this.hasRims) {
      grown = this.rim.set(vertexRims(coordinates, triangles)) || grown;
      this.hasRims = true;
    }
    this.materials.smooth = smooth;
    if (grown) this.attach();
  }

  private attach(): void {
    // Frees the old buffers on the card; those still in use are made again by the next drawing.
    for (const geometry of [this.solid, this.lines, this.cloud]) {
      geometry.dispose();
      geometry.setAttribute('position', this.position.attribute);
      geometry.setAttribute('uv', this.uv.attribute);
    }
    this.solid.setAttribute('normal', this.normal.attribute);
    this.solid.setAttribute('color', this.colour.attribute);
    this.solid.setAttribute('rim', this.rim.attribute);
    this.solid.setIndex(this.triangle.attribute);
    this.lines.setIndex(this.edge.attribute);
  }

  private apply(): void {
    this.solid.setDrawRange(0, this.triangleIndices);
    this.lines.setDrawRange(0, this.triangleIndices * 2);
    this.cloud.setDrawRange(0, this.vertices);
    const points = this.mode_ === 'points' || this.triangleIndices === 0;
    this.points.visible = points && this.vertices > 0;
    this.wires.visible = this.mode_ === 'wireframe' && !points;
    this.mesh.visible = !points;
    const has = { texture: this.textured, quality: this.hasQuality, colours: this.hasColours };
    this.points.material = this.materials.cloud(this.mode_, has);
    this.mesh.material = this.materials.solid(this.mode_, has);
  }

  private get wants(): Wants {
    return wantsOf(this.mode_, this.textured);
  }

  // Of confidence in its mode, else the surface's own.
  private setColours(): boolean {
    const { quality, colours } = this.frame!;
    if (this.mode_ === 'confidence' && quality !== null) return this.colour.set(confidenceColours(quality));
    return colours ? this.colour.set(colours) : false;
  }
}
