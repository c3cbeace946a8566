// SPDX-License-Identifier: Apache-2.0
// The surface on the graphics card. Buffers only grow, so that a mesh of changing size thirty times a second
// allocates nothing.
import * as THREE from 'three';
import type { DecodedFrame } from './messages';
import { confidenceColours } from './quality';
import { triangleEdges, vertexNormals } from './surface';

export type Mode = 'textured' | 'shaded' | 'wireframe' | 'points' | 'confidence';
export const kModes: readonly Mode[] = ['textured', 'shaded', 'wireframe', 'points', 'confidence'];

/** Colours of the surface where the texture is not shown; see style.css for the page's. */
const kClay = 0xd2ccc2;
const kWire = 0x86b7ff;
const kFill = 0x11151b;

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

export class SurfaceMesh {
  /** In the camera's frame (x right, y down, z forward), turned into three's (y up, z towards the viewer). */
  readonly object = new THREE.Group();
  private readonly position = floats(3);
  private readonly uv = floats(2);
  private readonly normal = floats(3);
  private readonly colour = floats(3); // of confidence
  private readonly triangle = indices();
  private readonly edge = indices();
  private readonly solid = new THREE.BufferGeometry();
  private readonly lines = new THREE.BufferGeometry();
  private readonly cloud = new THREE.BufferGeometry();
  private readonly texture = new THREE.Texture();
  private readonly materials = {
    textured: new THREE.MeshBasicMaterial({ map: this.texture, side: THREE.DoubleSide }),
    shaded: new THREE.MeshStandardMaterial({ color: kClay, roughness: 0.7, side: THREE.DoubleSide }),
    // Hides the lines behind the surface without covering those on it.
    fill: new THREE.MeshBasicMaterial({
      color: kFill,
      side: THREE.DoubleSide,
      polygonOffset: true,
      polygonOffsetFactor: 1,
      polygonOffsetUnits: 1,
    }),
    confidence: new THREE.MeshBasicMaterial({ vertexColors: true, side: THREE.DoubleSide }),
    wire: new THREE.LineBasicMaterial({ color: kWire }),
    points: new THREE.PointsMaterial({ map: this.texture, size: 2, sizeAttenuation: false }),
    plainPoints: new THREE.PointsMaterial({ color: kClay, size: 2, sizeAttenuation: false }),
  };
  private readonly mesh = new THREE.Mesh<THREE.BufferGeometry, THREE.Material>(this.solid, this.materials.textured);
  private readonly wires = new THREE.LineSegments(this.lines, this.materials.wire);
  private readonly points = new THREE.Points<THREE.BufferGeometry, THREE.Material>(this.cloud, this.materials.points);
  private mode_: Mode = 'textured';
  private vertices = 0;
  private triangleIndices = 0;
  private textured = false; // the frame shown has a picture and coordinates
  private hasNormals = false;
  private hasEdges = false;
  private hasQuality = false;

  constructor() {
    this.object.rotation.x = Math.PI;
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

  /** Drawn pixels to one of the page's. */
  setPixelRatio(ratio: number): void {
    this.materials.points.size = this.materials.plainPoints.size = 1.75 * ratio;
  }

  get mode(): Mode {
    return this.mode_;
  }
  set mode(mode: Mode) {
    this.mode_ = mode;
    this.derive();
    this.apply();
  }

  /** What the decoder should bring along for the mode. */
  get wants(): { normals: boolean; edges: boolean; quality: boolean } {
    return { normals: this.mode_ === 'shaded' || this.mode_ === 'confidence' || !this.textured, edges: this.mode_ === 'wireframe', quality: this.mode_ === 'confidence' };
  }

  show(frame: DecodedFrame): void {
    let grown = this.position.set(frame.positions);
    grown = this.triangle.set(frame.triangles) || grown;
    if (frame.coordinates !== null) grown = this.uv.set(frame.coordinates) || grown;
    if (frame.normals !== null) grown = this.normal.set(frame.normals) || grown;
    if (frame.edges !== null) grown = this.edge.set(frame.edges) || grown;
    if (frame.quality !== null) grown = this.colour.set(confidenceColours(frame.quality)) || grown;
    this.hasQuality = frame.quality !== null;
    this.vertices = frame.positions.length / 3;
    this.triangleIndices = frame.triangles.length;
    this.hasNormals = frame.normals !== null;
    this.hasEdges = frame.edges !== null;
    this.textured = frame.texture !== null && frame.coordinates !== null;
    if (frame.texture !== null) this.setTexture(frame.texture);
    if (grown) this.attach();
    this.derive();
    this.apply();
  }

  private setTexture(bitmap: ImageBitmap): void {
    const old = this.texture.image as ImageBitmap | undefined | null;
    // The card's storage is of a fixed size.
    if (old && (old.width !== bitmap.width || old.height !== bitmap.height)) this.texture.dispose();
    this.texture.image = bitmap;
    this.texture.needsUpdate = true;
    old?.close();
  }

  // A frame that came before the mode was chosen lacks what the mode needs; on a stalled stream no other comes.
  private derive(): void {
    const triangles = (this.triangle.attribute.array as Uint32Array).subarray(0, this.triangleIndices);
    let grown = false;
    if (this.mode_ === 'wireframe' && !this.hasEdges) {
      grown = this.edge.set(triangleEdges(triangles));
      this.hasEdges = true;
    }
    if ((this.mode_ === 'shaded' || this.mode_ === 'confidence' || !this.textured) && !this.hasNormals) {
      const positions = (this.position.attribute.array as Float32Array).subarray(0, this.vertices * 3);
      grown = this.normal.set(vertexNormals(positions, triangles)) || grown;
      this.hasNormals = true;
    }
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
    this.solid.setIndex(this.triangle.attribute);
    this.lines.setIndex(this.edge.attribute);
  }

  private apply(): void {
    this.solid.setDrawRange(0, this.triangleIndices);
    this.lines.setDrawRange(0, this.triangleIndices * 2);
    this.cloud.setDrawRange(0, this.vertices);
    const points = this.mode_ === 'points' || this.triangleIndices === 0;
    const wireframe = this.mode_ === 'wireframe' && !points;
    this.points.visible = points && this.vertices > 0;
    this.wires.visible = wireframe;
    this.mesh.visible = !points;
    this.points.material = this.textured ? this.materials.points : this.materials.plainPoints;
    if (wireframe) this.mesh.material = this.materials.fill;
    else if (this.mode_ === 'textured' && this.textured) this.mesh.material = this.materials.textured;
    else if (this.mode_ === 'confidence' && this.hasQuality) this.mesh.material = this.materials.confidence;
    else this.mesh.material = this.materials.shaded;
  }
}
