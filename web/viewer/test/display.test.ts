// SPDX-License-Identifier: Apache-2.0
// Proves: what a person chose comes back as it was, whatever else a store or a link holds.
import { describe, expect, it } from 'vitest';
import { kDefaultDisplay, parseDisplay, writeDisplay, type Display } from '../src/display';

describe('display', () => {
  it('comes back as it was written', () => {
    const chosen: Display = {
      mode: 'depth',
      way: 'camera',
      background: 'white',
      theme: 'light',
      grid: false, smooth: false,
      split: 'both',
      fov: 55,
    };
    expect(parseDisplay(writeDisplay(chosen).toString())).toEqual(chosen);
    expect(parseDisplay(writeDisplay({ ...kDefaultDisplay }, null).toString(), chosen)).toEqual(kDefaultDisplay);
  });

  it('writes only what differs', () => {
    expect(writeDisplay({ ...kDefaultDisplay, mode: 'points' }).toString()).toBe('mode=points');
  });

  it('knows what older links say of a picture beside the surface', () => {
    expect(parseDisplay('split=1').split).toBe('picture');
    expect(parseDisplay('split=0').split).toBe('none');
  });

  it.each(['', 'mode=', 'mode=none&way=%00&fov=1e9&grid=2', 'fov=NaN', '%%%', 'split=true'])(
    'falls back where %s makes no sense',
    (text) => expect(parseDisplay(text)).toEqual(kDefaultDisplay),
  );
});
