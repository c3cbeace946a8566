// SPDX-License-Identifier: Apache-2.0
// Geometry codecs 2 and 3 of codec/FORMAT.md, frame after frame. Runs in the worker.
import type { DracoDecoder } from './draco';
import { decodeDracoGrid } from './dracoGrid';
import { kTextureH264, type Frame } from './frame';
import { decodeSlices, openGrid, type KeyGrid } from './gridDecoder';
import { gridId, type GridFields } from './gridHead';
import type { GridKernel } from './gridKernel';
import { GridPoints, type GridSurface } from './gridPoints';
import { Spares } from './spares';
import { videoTextureIsKey } from './videoTexture';

/** Keeps the last key frame and what its calibration costs to work out. */
export class GridFrames {
  private key: KeyGrid | null = null;
  private points: GridPoints | null = null;
  private calibrationBytes = new Uint8Array(0);

  /** What decodes faster, as soon as it is there; without it all is done here. */
  kernel: GridKernel | null = null;
  readonly spares = new Spares();

  /** Throws where the geometry is not what the frame's header declares, or its key frame was not received. Any input. */
  decode(frame: Frame): GridSurface {
    const { vertices, triangles } = frame.header;
    if (vertices === 0) return emptySurface();
    const coded = openGrid(frame.geometry, vertices, triangles, this.key);
    const { head } = coded;
    const kernel = this.kernel !== null && this.kernel.takes(head) ? this.kernel : null;
    // What the kernel decodes lies there, and is copied only where it is needed here.
    const whole = kernel === null ? decodeSlices(coded) : null;
    kernel?.decode(coded);
    const isDelta = !head.isKey || (frame.textureCodec === kTextureH264 && !videoTextureIsKey(frame.texture));
    if (isDelta === frame.isKey) throw new Error('frame and geometry do not agree whether this is a key frame');
    const points = this.use(head);
    if (points === null) throw new Error('geometry has no calibration');
    const there = kernel !== null && kernel.takesPoints(points);
    if (head.isKey) this.key = { id: gridId(frame.geometry), grid: whole ?? kernel!.copyKey() };
    return there ? kernel.toSurface(points, this.spares) : points.toSurface(whole ?? kernel!.copy());
  }

  /** The same of codec 3. */
  decodeInDraco(frame: Frame, draco: DracoDecoder): GridSurface {
    const { vertices, triangles } = frame.header;
    if (vertices === 0) return emptySurface();
    const { head, grid } = decodeDracoGrid(frame.geometry, vertices, triangles, draco);
    return this.use(head)!.toSurface(grid);
  }

  /** The points of the calibration from now on: that of the head, where it has one. */
  private use({ calibration, calibrationBytes: bytes }: GridFields): GridPoints | null {
    if (calibration === null) return this.points;
    const same = bytes.length === this.calibrationBytes.length && bytes.every((b, i) => b === this.calibrationBytes[i]);
    if (!same || this.points === null) {
      this.points = new GridPoints(calibration);
      this.calibrationBytes = bytes.slice();
      this.key = null; // it has the calibration of before
    }
    return this.points;
  }
}

function emptySurface(): GridSurface {
  const none = new Float32Array(0);
  return { positions: none, coordinates: new Float32Array(0), triangles: new Uint32Array(0), quality: null };
}
