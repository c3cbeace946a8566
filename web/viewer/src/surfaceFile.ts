// SPDX-License-Identifier: Apache-2.0
// Surfaces from PLY and GLB files. Loaded when the first such file is opened.
import * as THREE from 'three';
import { GLTFLoader, type GLTFParser } from 'three/examples/jsm/loaders/GLTFLoader.js';
import { PLYLoader } from 'three/examples/jsm/loaders/PLYLoader.js';
import { FileError } from './fileError';
import { checkGlb } from './glbCheck';
import { glbDraco } from './glbDraco';
import type { DecodedFrame } from './messages';
import { checkPly } from './plyCheck';
import { text } from './strings';
import { robustExtent, type Extent } from './surface';

const kHeaderBytes = 2000; // more than the comments of a PLY take
const kMaxVertices = 2 ** 25;

/** Throws where the file is none, damaged, or has nothing to show: a FileError, or whatever three's loaders throw. */
export async function readSurface(name: string, bytes: ArrayBuffer): Promise<DecodedFrame> {
  return /\.ply$/i.test(name) ? readPly(bytes) : readGlb(bytes);
}

function readPly(bytes: ArrayBuffer): DecodedFrame {
  checkPly(new Uint8Array(bytes));
  const header = new TextDecoder('latin1').decode(bytes.slice(0, kHeaderBytes));
  const loader = new PLYLoader();
  loader.setCustomPropertyNameMapping({ sigma: ['sigma'], interpolated: ['interpolated'] });
  const geometry = loader.parse(bytes);
  // Ours say so; others count upwards.
  const frame = toFrame([{ geometry, matrix: /camera frame/.test(header) ? null : new THREE.Matrix4() }]);
  // NaN where the file has none.
  const sigmas = Float32Array.from(geometry.getAttribute('sigma').array, (sigma) => (sigma > 0 && sigma < Infinity ? sigma : 0));
  if (sigmas.some((sigma) => sigma > 0)) {
    frame.quality = { sigmas, interpolated: Uint8Array.from(geometry.getAttribute('interpolated').array) };
  }
  return frame;
}

async function readGlb(bytes: ArrayBuffer): Promise<DecodedFrame> {
  checkGlb(bytes);
  let picture: ImageBitmap | null = null;
  const loader = new GLTFLoader().setDRACOLoader(glbDraco());
  // The loader's own way goes through blob: addresses, which the page's content policy forbids.
  loader.register((parser) => ({
    name: 'pictures',
    loadTexture: async (index: number) => {
      picture ??= await readPicture(parser, index);
      return new THREE.Texture();
    },
  }));
  const { scene } = await loader.parseAsync(bytes, '');
  scene.updateMatrixWorld(true);
  const parts: Part[] = [];
  scene.traverse((node) => {
    if (node instanceof THREE.Mesh || node instanceof THREE.Points) {
      parts.push({ geometry: node.geometry as THREE.BufferGeometry, matrix: node.matrixWorld });
    }
  });
  const frame = toFrame(parts);
  frame.texture = frame.coordinates === null ? null : picture;
  return frame;
}

interface GltfJson {
  textures: { source: number }[];
  images: { bufferView?: number; mimeType?: string }[];
}

async function readPicture(parser: GLTFParser, texture: number): Promise<ImageBitmap> {
  const json = parser.json as GltfJson;
  const image = json.images[json.textures[texture]!.source]!;
  if (image.bufferView === undefined) throw new FileError(text.file.elsewhere);
  const bytes = (await parser.getDependency('bufferView', image.bufferView)) as ArrayBuffer;
  const blob = new Blob([bytes], { type: image.mimeType ?? 'image/png' });
  return createImageBitmap(blob, { colorSpaceConversion: 'none', premultiplyAlpha: 'none' });
}

interface Part {
  geometry: THREE.BufferGeometry;
  matrix: THREE.Matrix4 | null; // to y up, z towards the viewer; null: it is in the rig camera's frame
}

function toFrame(parts: Part[]): DecodedFrame {
  const vertices = parts.reduce((sum, { geometry }) => sum + geometry.getAttribute('position').count, 0);
  if (vertices === 0) throw new FileError(text.file.noSurface);
  if (vertices > kMaxVertices) throw new FileError(text.file.tooManyVertices);
  const positions = new Float32Array(vertices * 3);
  const coordinates = all(parts, 'uv') ? new Float32Array(vertices * 2) : null;
  const colours = all(parts, 'color') ? new Float32Array(vertices * 3) : null;
  const corners = parts.reduce((sum, { geometry }) => sum + (geometry.getIndex()?.count ?? 0), 0);
  const triangles = new Uint32Array(corners);
  let [base, corner] = [0, 0];
  for (const { geometry, matrix } of parts) {
    const place = geometry.getAttribute('position');
    const [uv, colour] = [geometry.getAttribute('uv'), geometry.getAttribute('color')];
    const at = new THREE.Vector3();
    for (let v = 0; v < place.count; ++v) {
      at.fromBufferAttribute(place, v);
      if (matrix !== null) {
        at.applyMatrix4(matrix);
        at.set(at.x, -at.y, -at.z);
      }
      at.toArray(positions, (base + v) * 3);
      if (coordinates !== null) coordinates.set([uv!.getX(v), uv!.getY(v)], (base + v) * 2);
      if (colours !== null) colours.set([colour!.getX(v), colour!.getY(v), colour!.getZ(v)], (base + v) * 3);
    }
    const index = geometry.getIndex();
    for (let i = 0; i < (index?.count ?? 0); ++i) {
      const of = index!.getX(i);
      if (!(of >= 0 && of < place.count)) throw new FileError(text.file.damaged);
      triangles[corner++] = base + of;
    }
    base += place.count;
  }
  const extent = robustExtent(positions) ?? box(positions);
  if (![...extent.min, ...extent.max].every(Number.isFinite)) throw new FileError(text.file.damaged);
  return {
    type: 'frame',
    id: 0,
    number: 0,
    positions,
    coordinates,
    colours,
    normals: null,
    triangles,
    edges: null,
    quality: null,
    texture: null,
    extent,
    notice: null,
    decodeMs: 0,
  };
}

const all = (parts: Part[], name: string): boolean => parts.every(({ geometry }) => geometry.hasAttribute(name));

function box(positions: Float32Array): Extent {
  const of = (pick: (...v: number[]) => number): [number, number, number] =>
    [0, 1, 2].map((axis) => pick(...positions.filter((_, i) => i % 3 === axis))) as [number, number, number];
  const [min, max] = [of(Math.min), of(Math.max)];
  return { min, max, centre: min.map((low, i) => (low + max[i]!) / 2) as [number, number, number], depths: [min[2], max[2]] };
}
