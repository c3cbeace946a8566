// SPDX-License-Identifier: Apache-2.0
// Decodes frames off the main thread, one after the other.
import type { DracoDecoder, Geometry } from './draco';
import { kGeometryDraco, kGeometryDracoGrid, kGeometryGrid, kTextureH264, kTextureJpeg, kTexturePng, kTextureWebp, parseFrame, type Frame } from './frame';
import { buffersOf } from './frameMemory';
import { GridFrames } from './grid';
import gridWasmUrl from './grid.wasm?url';
import { loadDraco } from './loadDraco';
import type { DecodedFrame, DecodeReply, DecodeRequest } from './messages';
import { decodeVertexQuality, type VertexQuality } from './quality';
import { noVideoHere, VideoTextures } from './videoTexture';
import { vertexRims } from './rims';
import { robustExtent, triangleEdges, vertexNormals } from './surface';

const post = (reply: DecodeReply, transfer: Transferable[] = []): void => {
  self.postMessage(reply, { transfer });
};

const kStills: Record<number, string> = { [kTextureJpeg]: 'image/jpeg', [kTextureWebp]: 'image/webp', [kTexturePng]: 'image/png' };

const kAsItIs: ImageBitmapOptions = { colorSpaceConversion: 'none', premultiplyAlpha: 'none' };

const grids = new GridFrames();
const videos = new VideoTextures();
const kKernelWithinMs = 300; // the first grid takes about as long without, as code that has never run
const kernel = Promise.race([loadKernel(), new Promise((resolve) => setTimeout(resolve, kKernelWithinMs))]);
const kOfDraco = [kGeometryDraco, kGeometryDracoGrid];
const kDracoTries = 3;
const kDracoAgainMs = 1000;
const draco = { loaded: null as DracoDecoder | null, failure: '', failures: 0, failedAt: -Infinity };
let queue: Promise<void> = Promise.resolve();
post({ type: 'ready' });

self.onmessage = (event: MessageEvent<DecodeRequest>) => {
  const request = event.data;
  grids.spares.add(request.spares);
  queue = queue.then(async () => {
    try {
      const frame = await decode(request);
      const pictures = [frame.texture, frame.handOn].filter((picture) => picture != null);
      post(frame, [...buffersOf(frame), ...pictures]);
    } catch (error) {
      post({ type: 'failed', id: request.id, message: error instanceof Error ? error.message : String(error) });
    }
  });
};

/** Where a stream needs it: most do not. Tried again, a few times, where it does not come. */
async function theDraco(): Promise<DracoDecoder> {
  if (draco.loaded !== null) return draco.loaded;
  if (performance.now() - draco.failedAt < kDracoAgainMs) throw new Error(draco.failure);
  post({ type: 'loading' });
  try {
    draco.loaded = await loadDraco();
    return draco.loaded;
  } catch (error) {
    draco.failure = `the Draco decoder cannot be loaded: ${error instanceof Error ? error.message : String(error)}`;
    draco.failedAt = performance.now();
    if (++draco.failures === kDracoTries) post({ type: 'unusable', message: draco.failure });
    throw new Error(draco.failure);
  } finally {
    post({ type: 'ready' });
  }
}

async function decode(request: DecodeRequest): Promise<DecodedFrame> {
  const frame = parseFrame(new Uint8Array(request.bytes, request.offset));
  const needsDraco = frame.header.vertices > 0 && kOfDraco.includes(frame.geometryCodec);
  const draco = needsDraco ? await theDraco() : null;
  if (frame.geometryCodec === kGeometryGrid) await kernel;
  const start = performance.now();
  const picture = decodeTexture(frame); // the browser decodes it meanwhile, on a thread of its own
  picture.catch(() => undefined); // awaited below, unless the geometry fails first
  const geometry = decodeGeometry(draco, frame, request.want.quality);
  const { positions, coordinates } = geometry;
  const normals =
    geometry.normals ?? (request.want.normals ? vertexNormals(positions, geometry.triangles) : null);
  const edges = request.want.edges ? triangleEdges(geometry.triangles) : null;
  const rims = request.want.rims && coordinates !== null ? vertexRims(coordinates, geometry.triangles, (n) => grids.spares.floats(n)) : null;
  const texture = await picture;
  return {
    type: 'frame',
    id: request.id,
    number: Number(frame.header.number),
    positions,
    coordinates,
    normals,
    triangles: geometry.triangles,
    edges,
    quality: geometry.quality,
    codedQuality: geometry.quality === null && frame.quality.length > 0 ? frame.quality.slice() : null, // for who stops here, and asks then
    rims,
    texture,
    handOn: texture === null ? null : await createImageBitmap(texture, kAsItIs),
    notice: frame.textureCodec === kTextureH264 && !VideoTextures.possible ? noVideoHere() : null,
    extent: robustExtent(positions),
    decodeMs: performance.now() - start,
  };
}

/** What decodes grids is there, or will not be in time: they are decoded without until it is, and where the browser cannot run it. */
async function loadKernel(): Promise<void> {
  try {
    const [response, { GridKernel }] = await Promise.all([fetch(gridWasmUrl), import('./gridKernel')]);
    if (response.ok) grids.kernel = await GridKernel.create(await response.arrayBuffer());
  } catch {
    // decoded without
  }
}

const kNoSurface = (): Geometry & { quality: null } => ({
  positions: new Float32Array(0),
  coordinates: null,
  normals: null,
  triangles: new Uint32Array(0),
  quality: null,
});

/** Of a grid the quality is there with the positions; of Draco it is decoded where it is wanted. */
function decodeGeometry(draco: DracoDecoder | null, frame: Frame, wantQuality: boolean): Geometry & { quality: VertexQuality | null } {
  if (frame.geometryCodec === kGeometryGrid) return { normals: null, ...grids.decode(frame) };
  if (frame.header.vertices === 0 && kOfDraco.includes(frame.geometryCodec)) return kNoSurface();
  if (draco === null) throw new Error(`geometry codec ${frame.geometryCodec} is not known here`);
  if (frame.geometryCodec === kGeometryDracoGrid) return { normals: null, ...grids.decodeInDraco(frame, draco) };
  const geometry = draco.decode(frame);
  const told = wantQuality && frame.quality.length > 0 && geometry.coordinates !== null;
  return { ...geometry, quality: told ? decodeVertexQuality(frame.quality, geometry.coordinates!) : null };
}

async function decodeTexture(frame: Frame): Promise<ImageBitmap | null> {
  if (frame.texture.length === 0) return null;
  if (frame.textureCodec === kTextureH264) {
    if (!VideoTextures.possible) return null;
    return videos.decode(frame.texture, frame.header.textureWidth, frame.header.textureHeight);
  }
  const type = kStills[frame.textureCodec];
  if (type === undefined) throw new Error(`texture codec ${frame.textureCodec} is not known here`);
  // Copied into the Blob by the browser; nothing here keeps the bytes.
  const blob = new Blob([frame.texture as Uint8Array<ArrayBuffer>], { type });
  const bitmap = await createImageBitmap(blob, kAsItIs);
  const { textureWidth, textureHeight } = frame.header;
  if (bitmap.width !== textureWidth || bitmap.height !== textureHeight) {
    bitmap.close();
    throw new Error('the texture is not of the size that the frame declares');
  }
  return bitmap;
}
