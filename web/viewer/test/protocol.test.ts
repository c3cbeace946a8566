// SPDX-License-Identifier: Apache-2.0
import { describe, expect, it } from 'vitest';
import { offeredRungs, parseServerMessage, wantedQuality, type StreamStatus } from '../src/protocol';
import { choices, whyText } from '../src/qualityControl';

describe('the quality that an address asks for', () => {
  it('is one of those there are, or none', () => {
    expect(wantedQuality('?stream=face&quality=auto')).toBe('auto');
    expect(wantedQuality('?quality=reduced')).toBe('reduced');
    expect(wantedQuality('?quality=best')).toBeNull();
    expect(wantedQuality('')).toBeNull();
  });
  it('is answered by what comes, of those that there are', () => {
    const told = '{"type":"quality","now":"reduced","of":["full","reduced"]}';
    expect(parseServerMessage(told)).toEqual({ type: 'quality', now: 'reduced', of: ['full', 'reduced'] });
    expect(parseServerMessage('{"type":"quality","now":"finest","of":["full","finest"]}')).toBeNull();
    expect(parseServerMessage('{"type":"quality","now":"full","of":["full","finest"]}')).toMatchObject({ of: ['full'] });
    expect(parseServerMessage('{"type":"quality","now":"full"}')).toBeNull();
  });
  it('is one of those that the stream is offered in', () => {
    const status = { rungs: [{ quality: 'texture' }, { quality: 'finest' }] } as unknown as StreamStatus;
    expect(offeredRungs(status)).toEqual(['full', 'texture']);
    expect(offeredRungs(null)).toEqual(['full']);
  });
});

describe('what a person may choose, and is told', () => {
  const three = ['full', 'reduced', 'texture'] as const;
  it('is what there is, and what was chosen before', () => {
    expect(choices({ want: null, now: 'full', of: three })).toEqual(['auto', 'full', 'reduced', 'texture']);
    expect(choices({ want: null, now: 'full', of: ['full'] })).toEqual(['full']);
    expect(choices({ want: 'reduced', now: 'full', of: ['full'] })).toEqual(['full', 'reduced']);
  });
  it('says why', () => {
    expect(whyText({ want: null, now: 'full', of: three })).toMatch(/nothing else was asked for/);
    expect(whyText({ want: 'auto', now: 'full', of: three })).toMatch(/can follow/);
    expect(whyText({ want: 'auto', now: 'reduced', of: three })).toMatch(/^Reduced comes: .*could not follow more/);
    expect(whyText({ want: 'reduced', now: 'reduced', of: three })).toMatch(/as chosen/);
    expect(whyText({ want: 'texture', now: 'full', of: three })).toMatch(/^Full comes until “Picture alone”/);
    expect(whyText({ want: 'texture', now: 'full', of: ['full', 'reduced'] })).toMatch(/has no “Picture alone”/);
    expect(whyText({ want: null, now: 'full', of: ['full'] })).toMatch(/in full only/);
    expect(whyText({ want: 'full', now: 'full', of: three, offline: true })).toMatch(/does not answer/);
  });
});
