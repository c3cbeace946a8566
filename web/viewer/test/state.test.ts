// SPDX-License-Identifier: Apache-2.0
// Proves: what the page says follows from what it knows, and an old picture is never called live.
import { describe, expect, it } from 'vitest';
import { backoffS, patienceMs, present, type Facts } from '../src/state';

const live: Facts = {
  problem: null,
  everConnected: true,
  connected: true,
  retryInS: null,
  refusal: null,
  stream: 'face',
  announced: true,
  seen: true,
  serverState: 'running',
  serverMessage: '',
  quietMs: 30,
  frameRate: 30,
  hint: 'relievo-server serve --source sim:face',
  file: null,
  shifted: null,
};

describe('present', () => {
  it.each<[string, Partial<Facts>, string]>([
    ['a running stream', {}, 'live'],
    ['a paused recording, however old', { file: 'paused', connected: false, quietMs: 1e9 }, 'file'],
    ['what was of a stream, also of one that left', { shifted: 'paused', connected: false, quietMs: 1e9 }, 'shifted'],
    ['no WebGL', { problem: 'no WebGL 2' }, 'unsupported'],
    ['the first attempt', { everConnected: false, connected: false }, 'connecting'],
    ['a server that is not there', { everConnected: false, connected: false, retryInS: 2 }, 'lost'],
    ['a lost connection', { connected: false, retryInS: 3 }, 'lost'],
    ['a server whose places are taken', { connected: false, retryInS: 3, refusal: 'places' }, 'lost'],
    ['a name that no stream can have', { everConnected: false, connected: false, retryInS: 3, refusal: 'name' }, 'refused'],
    ['nothing to watch', { stream: null, announced: false, seen: false }, 'empty'],
    ['a recording that is on its way', { stream: null, opening: 'walk.mcap', announced: false, seen: false }, 'connecting'],
    ['a stream that is not there yet', { announced: false, seen: false }, 'waiting'],
    ['a stream that left', { announced: false }, 'ended'],
    ['a stream whose source is at its end', { serverState: 'ended' }, 'ended'],
    ['no frame yet', { seen: false }, 'starting'],
    ['a stall the server knows', { serverState: 'stalled' }, 'stalled'],
    ['a silence the server does not know', { quietMs: 2500 }, 'stalled'],
    ['a silence with no status at all', { serverState: null, quietMs: 2500 }, 'stalled'],
  ])('%s', (_, facts, state) => {
    const shown = present({ ...live, ...facts });
    expect(shown.state).toBe(state);
    expect(shown.title === '').toBe(state === 'live' || state === 'shifted' || state === 'file');
    if (['lost', 'stalled', 'ended', 'unsupported'].includes(state)) expect(shown.dim).toBe(true);
  });

  it('says how to start a stream and when it tries again', () => {
    expect(present({ ...live, stream: null }).hint).toBe(live.hint);
    expect(present({ ...live, stream: null, seen: false, opening: 'walk.mcap' }).title).toBe('Opening walk.mcap');
    expect(present({ ...live, connected: false, retryInS: 3 }).text).toContain('in 3 s');
    expect(present({ ...live, serverState: 'stalled', serverMessage: 'No signal.' }).text).toContain('No signal.');
  });

  it('says of a live stream what its server has to say', () => {
    const guessed = 'The rig is not calibrated: its shapes are guesses until it is.';
    expect(present({ ...live, serverMessage: guessed })).toMatchObject({ state: 'live', title: '', note: guessed });
    expect(present({ ...live, serverMessage: guessed, shifted: 'paused' }).note).toBe(''); // it is of now
    expect(present(live).note).toBe('');
  });

  it('says why it was refused', () => {
    expect(present({ ...live, connected: false, retryInS: 3, refusal: 'places' })).toMatchObject({ label: 'Full', title: 'All places are taken' });
    expect(present({ ...live, connected: false, refusal: 'name' }).title).toBe('No stream can have this name');
  });

  it('says of what was that nothing comes any more', () => {
    const label = (facts: Partial<Facts>): string => present({ ...live, shifted: 'paused', ...facts }).label;
    expect(label({})).toBe('Paused');
    expect(label({ connected: false, retryInS: 1 })).toBe('Paused · Offline');
    expect(label({ serverState: 'ended' })).toBe('Paused · Ended');
    expect(label({ quietMs: 1e9 })).toBe('Paused'); // nothing is shown of what comes
  });

  it('says that a recording does not come, and why', () => {
    const missing = (why: string, passing: boolean): object => present({ ...live, file: 'playing', missing: { why, passing } });
    expect(missing('', true)).toMatchObject({ state: 'stalled', title: 'The recording does not come', dim: true });
    expect(missing('', true)).toMatchObject({ text: 'Nothing of it has come for a while. It goes on by itself when more comes.' });
    expect(missing('the server does not answer', true)).toMatchObject({ text: 'The server does not answer. It goes on by itself when more comes.' });
    expect(missing('it has changed', false)).toMatchObject({ text: 'It has changed.' });
  });

  it('is patient with slow streams', () => {
    expect(patienceMs(30)).toBe(2000);
    expect(patienceMs(1)).toBe(10_000);
    expect(patienceMs(0)).toBe(2000);
  });

  it('waits longer each time, ten seconds at most', () => {
    expect([0, 1, 2, 3, 4, 50].map(backoffS)).toEqual([1, 2, 4, 8, 10, 10]);
  });
});
