// SPDX-License-Identifier: Apache-2.0
// What a rig itself is wrong by, from what its calibration found (docs/viewer.md). Pure data, so that it can be kept.
import type { Vec3 } from './pick';
import type { StreamInfo } from './protocol';

export interface RigError {
  scale: number; // relative, of all sizes
  camera: number; // radians, of a ray of either device across the stripes
  projector: number;
  centre: Vec3; // of the projector, in the camera's frame; metres
}

/** Null where the rig does not say it. */
export function rigErrorOf(info: StreamInfo | null): RigError | null {
  const { projector, projector_from_camera_rotation: r, projector_from_camera_translation: t } = info ?? {};
  const [rms, scale] = [info?.stereo_rms_px ?? 0, info?.scale_error ?? 0];
  if (info === null || !projector || r?.length !== 9 || t?.length !== 3 || !(rms > 0 || scale > 0)) return null;
  const centre = [0, 1, 2].map((i) => -(r[i]! * t[0]! + r[i + 3]! * t[1]! + r[i + 6]! * t[2]!)) as Vec3;
  const across = rms * Math.SQRT1_2; // of the two directions in a picture
  const error = { scale, camera: across / info.camera.fx, projector: across / projector.fx, centre };
  return [scale, error.camera, error.projector, ...centre].every(Number.isFinite) ? error : null;
}

/** Of a point's depth: both rays' errors through the triangle of camera, projector and point. */
export function rigDepthError({ camera, projector, centre }: RigError, [x, y, z]: Vec3): number {
  const [u, v, w] = [x - centre[0], y - centre[1], z - centre[2]];
  const sine = Math.hypot(y * w - z * v, z * u - x * w, x * v - y * u); // times both distances, as the cosine
  return (Math.abs(z) * Math.hypot(camera * (x * u + y * v + z * w), projector * (u * u + v * v + w * w))) / sine;
}
