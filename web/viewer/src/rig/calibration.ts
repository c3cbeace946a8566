// SPDX-License-Identifier: Apache-2.0
// What the server says of a calibration, and orders to it: /api/calibration (docs/WEB.md).
import { ask, pictureAt } from './look';

export const kSides = ['left', 'right', 'upper', 'lower'] as const;
export type Side = (typeof kSides)[number];
export type Kind = 'colour' | 'geometry';
export type Action = 'take' | 'automatic' | 'manual' | 'calculate' | 'more' | 'keep' | 'cancel';

export interface ColourResult {
  residual: number;
  threshold: number;
  colours: { colour: string; residual: number; margin?: number }[];
}

export interface GeometryResult {
  stereo_rms_px: number;
  stereo_rms_all_corners_px: number;
  plane_rms_mm: number;
  square_error_mm: number;
  baseline_mm: number;
  distance_m: number;
  depth_sigma_mm: number;
  views: { name: string; used: boolean; stereo_rms_px?: number; why?: string }[];
}

export interface Calibration {
  state: 'off' | 'pausing' | 'watching' | 'busy' | 'solved';
  stream: string;
  kind: Kind | '';
  board: string;
  next: string;
  message: string;
  failed: boolean;
  at_rest: number;
  cycle: number;
  armed: boolean;
  automatic: boolean;
  can_calculate: boolean;
  enough: boolean;
  views: { name: string; used: boolean; says: string }[];
  result: ColourResult | GeometryResult | null;
  file: string;
  file_before: string;
  coverage: boolean;
  tilts: Side[];
}

export const isGeometry = (result: ColourResult | GeometryResult): result is GeometryResult => 'stereo_rms_px' in result;

export const calibrationNow = async (): Promise<Calibration> =>
  (await (await ask('api/calibration')).json()) as Calibration;

const post = async (order: object): Promise<Calibration> => {
  const response = await ask('api/calibration', {
    method: 'POST',
    headers: { 'content-type': 'application/json' },
    body: JSON.stringify(order),
  });
  return (await response.json()) as Calibration;
};

export const startCalibration = (stream: string, kind: Kind, board: string): Promise<Calibration> =>
  post({ action: 'start', stream, kind, board });

export const orderCalibration = (action: Action): Promise<Calibration> => post({ action });

export const calibrationPicture = (name: 'camera' | 'coverage'): Promise<ImageBitmap | null> =>
  pictureAt(`api/calibration/${name}.jpg`);
