// SPDX-License-Identifier: Apache-2.0
// What a calibration found, and whether that is good.
import { make } from '../dom';

import { isGeometry, type ColourResult, type GeometryResult } from './calibration';
import { text } from './strings';

const say = text.calibration.result;
const kResidualMost = 12; // of 255: more is stray light, or a curved response (docs/CALIBRATION.md)
const kStereoMost_px = 0.5;
const kDepthMost = 1; // mm a metre
const kAllMost_px = 5; // with the corners left out: more is no noise, but a pattern laid over another size than was projected

function figures(rows: readonly (readonly [key: string, name: string, value: string, bad?: boolean])[]): HTMLElement {
  const list = make('dl', { className: 'figures' });
  for (const [key, name, value, bad] of rows) {
    const shown = make('dd', { className: bad === true ? 'bad' : '' }, value);
    shown.dataset['figure'] = key;
    list.append(make('dt', {}, name), shown);
  }
  return list;
}

const paletteOf = ({ colours }: ColourResult) => colours.filter(({ margin }) => margin !== undefined);
const weakOf = (result: ColourResult) => paletteOf(result).filter(({ margin }) => margin! <= 0);
const fits = (result: GeometryResult): boolean => result.stereo_rms_px <= kStereoMost_px;
const isWhole = (result: GeometryResult): boolean => result.stereo_rms_all_corners_px <= kAllMost_px;
const isExact = (result: GeometryResult): boolean => result.depth_sigma_mm <= kDepthMost * result.distance_m;

/** Whether it should be kept; else more should be taken. */
export const isGood = (result: ColourResult | GeometryResult): boolean =>
  isGeometry(result) ? fits(result) && isWhole(result) && isExact(result) : weakOf(result).length === 0 && result.residual <= kResidualMost;

/** What a person should know of it first. */
export function verdictOf(result: GeometryResult): string {
  if (!fits(result)) return say.stereoHigh;
  if (!isWhole(result)) return say.leftOutHigh(result.stereo_rms_all_corners_px.toFixed(1));
  return isExact(result) ? say.good : say.depthOpen;
}

function colours(result: ColourResult): HTMLElement[] {
  const palette = paletteOf(result);
  const rows = palette.map(({ colour, residual, margin }) => {
    const name = make(
      'th',
      { scope: 'row' },
      make('i', { className: `colour colour-${colour}` }),
      text.colours[colour] ?? colour,
    );
    const value = make('td', { className: margin! <= 0 ? 'bad' : '' }, margin!.toFixed(0));
    return make('tr', {}, name, value, make('td', {}, residual.toFixed(1)));
  });
  const weak = weakOf(result).map(({ colour }) => text.colours[colour] ?? colour);
  const good = isGood(result);
  return [
    make('p', { className: good ? 'used' : 'bad' }, weak.length > 0 ? say.weak(weak) : good ? say.good : say.residualHigh),
    figures([['residual', say.residual, result.residual.toFixed(1), result.residual > kResidualMost]]),
    make(
      'table',
      {},
      make('thead', {}, make('tr', {}, ...say.columns.map((name) => make('th', { scope: 'col' }, name)))),
      make('tbody', {}, ...rows),
    ),
  ];
}

function geometry(result: GeometryResult): HTMLElement[] {
  const views = result.views.map(({ name, used, stereo_rms_px, why }) => {
    const value = make('td', { className: used ? '' : 'bad' }, used ? `${stereo_rms_px!.toFixed(3)} px` : why ?? '');
    return make('tr', {}, make('th', { scope: 'row' }, name), value);
  });
  return [
    make('p', { className: isGood(result) ? 'used' : 'bad' }, verdictOf(result)),
    figures([
      ['stereo', say.stereo, `${result.stereo_rms_px.toFixed(3)} px`, !fits(result)],
      ['all', say.all, `${result.stereo_rms_all_corners_px.toFixed(3)} px`, !isWhole(result)],
      ['depth', say.depth, `± ${result.depth_sigma_mm.toFixed(1)} mm`, !isExact(result)],
      ['plane', say.plane, `${result.plane_rms_mm.toFixed(2)} mm`],
      ['squares', say.squares, `${result.square_error_mm.toFixed(2)} mm`],
      ['baseline', say.baseline, `${result.baseline_mm.toFixed(1)} mm`],
      ['distance', say.distance, `${result.distance_m.toFixed(2)} m`],
    ]),
    make('table', { className: 'residuals' }, make('caption', { className: 'quiet' }, say.views), make('tbody', {}, ...views)),
  ];
}

export const resultOf = (result: ColourResult | GeometryResult): HTMLElement[] =>
  isGeometry(result) ? geometry(result) : colours(result);
