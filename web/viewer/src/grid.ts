// SPDX-License-Identifier: Apache-2.0
// Geometry codec 2 of codec/FORMAT.md, frame after frame. Runs in the worker.
import { kTextureH264, type Frame } from './frame';
import { decodeGrid, type KeyGrid } from './gridDecoder';
import { gridId } from './gridHead';
import { GridPoints, type GridSurface } from './gridPoints';
import { videoTextureIsKey } from './videoTexture';

/** Keeps the last key frame and what its calibration costs to work out. */
export class GridFrames {
  private key: KeyGrid | null = null;
  private points: GridPoints | null = null;
  private calibrationBytes = new Uint8Array(0);

  /** Throws where the geometry is not what the frame's header declares, or its key frame was not received. Any input. */
  decode(frame: Frame): GridSurface {
    const { vertices, triangles } = frame.header;
    if (vertices === 0) {
      const none = new Float32Array(0);
      return { positions: none, coordinates: new Float32Array(0), triangles: new Uint32Array(0), quality: null };
    }
    const { head, grid } = decodeGrid(frame.geometry, vertices, triangles, this.key);
    const isDelta = !head.isKey || (frame.textureCodec === kTextureH264 && !videoTextureIsKey(frame.texture));
    if (isDelta === frame.isKey) throw new Error('frame and geometry do not agree whether this is a key frame');
    if (head.calibration !== null) {
      this.key = { id: gridId(frame.geometry), grid };
      const bytes = head.calibrationBytes;
      const same = bytes.length === this.calibrationBytes.length && bytes.every((b, i) => b === this.calibrationBytes[i]);
      if (!same || this.points === null) {
        this.points = new GridPoints(head.calibration);
        this.calibrationBytes = bytes.slice();
      }
    }
    if (this.points === null) throw new Error('geometry has no calibration');
    return this.points.toSurface(grid);
  }
}
