// SPDX-License-Identifier: Apache-2.0
import { describe, expect, it } from 'vitest';
import { parseServerMessage, wantedQuality } from '../src/protocol';

describe('the quality that an address asks for', () => {
  it('is one of those there are, or none', () => {
    expect(wantedQuality('?stream=face&quality=auto')).toBe('auto');
    expect(wantedQuality('?quality=reduced')).toBe('reduced');
    expect(wantedQuality('?quality=best')).toBeNull();
    expect(wantedQuality('')).toBeNull();
  });
  it('is answered by a message that a page may ignore', () => {
    expect(parseServerMessage('{"type":"quality","now":"reduced","of":["full","reduced"]}')).toBeNull();
  });
});
