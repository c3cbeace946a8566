// SPDX-License-Identifier: Apache-2.0
// What GLTFLoader asks of three's DRACOLoader, which itself starts a worker from a blob: address, as the page's content policy
// forbids. For files that are opened now and then: it decodes where it is called.
import * as THREE from 'three';
import type { DRACOLoader } from 'three/examples/jsm/loaders/DRACOLoader.js';
import type { DracoDecoder, Geometry } from './draco';
import { loadDraco } from './loadDraco';

class GlbDraco {
  private decoder: Promise<DracoDecoder> | null = null;

  /** The loader calls it for files that need Draco, and for no other. */
  preload(): this {
    this.decoder ??= loadDraco();
    this.decoder.catch(() => undefined); // told by who waits for it
    return this;
  }

  /** The names of attributes say enough: glTF has one of each that is shown. */
  decodeDracoFile(
    bytes: ArrayBuffer,
    done: (geometry: THREE.BufferGeometry) => void,
    _ids: unknown,
    _types: unknown,
    _colours: unknown,
    failed: (error: unknown) => void,
  ): void {
    this.preload()
      .decoder!.then((decoder) => done(toGeometry(decoder.mesh(new Uint8Array(bytes)))))
      .catch(failed);
  }
}

function toGeometry({ positions, coordinates, normals, triangles }: Geometry): THREE.BufferGeometry {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(positions, 3));
  if (coordinates !== null) geometry.setAttribute('uv', new THREE.BufferAttribute(coordinates, 2));
  if (normals !== null) geometry.setAttribute('normal', new THREE.BufferAttribute(normals, 3));
  geometry.setIndex(new THREE.BufferAttribute(triangles, 1));
  return geometry;
}

export const glbDraco = (): DRACOLoader => new GlbDraco() as unknown as DRACOLoader;
