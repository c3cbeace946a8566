// SPDX-License-Identifier: Apache-2.0
import type { StreamInfo } from '../src/protocol';

const kCamera = { width: 640, height: 480, fx: 800, fy: 801, cx: 319.5, cy: 239.5, distortion: [0.1, -0.2, 0, 0.001, 0] };
export const kInfo: StreamInfo = {
  stream: 'face',
  source: 'sim:face',
  frame_rate: 29.97,
  scan: 'progressive',
  stripes: 3,
  camera: kCamera,
  started_ns: 1_700_000_000_000_000_000,
  projector: { ...kCamera, width: 1024, height: 768 },
  projector_from_camera_rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1],
  projector_from_camera_translation: [0.2, 0, 0],
  field_order: 'top',
  stereo_rms_px: 0.25,
  scale_error: 5e-4,
  world_from_camera_rotation: [0, -1, 0, 1, 0, 0, 0, 0, 1],
  world_from_camera_translation: [1.5, -0.25, 2],
  camera_gamma: 2.2,
  colour_matrix: [1, 0, 0, 0, 1, 0, 0, 0, 1],
  pattern: { base: 6, slides: 2, palette: [1, 2, 4, 6, 5, 3], sequence: [0, 7, 14], scheme: 'complementary' },
};
