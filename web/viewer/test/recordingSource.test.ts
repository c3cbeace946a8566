// SPDX-License-Identifier: Apache-2.0
// Proves: who plays what is still being written plays on until it is whole and all of it was shown, however slowly.
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import type { ServerRecording } from '../src/protocol';
import type { Recording } from '../src/recording';
import { RecordingSource } from '../src/recordingSource';
import type { Moment } from '../src/source';

const kStepMs = 100;

/** Of a file of which `written` frames can be read. */
class Growing {
  written = 3;
  times = Float64Array.of(0, kStepMs, 2 * kStepMs);
  first = 0;
  startMs = 0;
  /** Captured 40 ms before they came. */
  timeOf = async (utcMs: number): Promise<number | null> => this.times.find((time) => time - 40 === utcMs) ?? null;
  /** Of frames from there on, 100 ms each. */
  infos = new Map<number, { source: string }>();
  infoAt = (publishMs: number): unknown => [...this.infos].filter(([from]) => from <= Math.max(0, publishMs)).at(-1)?.[1] ?? null;
  get end(): number {
    return this.times.length; // as bytes
  }
  async grow(): Promise<boolean> {
    const before = this.times.length;
    this.times = Float64Array.from({ length: this.written }, (_, i) => i * kStepMs);
    return this.written > before;
  }
  async readHeads(): Promise<void> {}
  isKey = (): boolean => true;
  gapBefore = (): number => 0;
  keyBefore = async (index: number): Promise<number> => index;
  buildsOnFrameBefore = async (): Promise<boolean> => false;
  read = async (index: number): Promise<unknown> => ({
    prefix: { bytes: 48, sequence: index, captureMs: 0, publishMs: index * kStepMs, sentMs: 0, drops: 0 },
    message: new ArrayBuffer(48),
  });
}

function told(file: Growing, state: 'recording' | 'writing its end' | 'off'): ServerRecording {
  return {
    state: state === 'recording' ? 'recording' : 'off',
    message: state === 'writing its end' ? 'its last frames are still being written' : '',
    whole_bytes: file.written,
  } as ServerRecording;
}

describe('RecordingSource', () => {
  beforeEach(() => {
    vi.useFakeTimers();
    vi.stubGlobal('window', globalThis);
  });
  afterEach(() => {
    vi.useRealTimers();
    vi.unstubAllGlobals();
  });

  /** A page that shows each frame at once while `quick`, else when its credit is given by hand. */
  function playing(file = new Growing(), begin: Moment | null = null): { file: Growing; source: RecordingSource; shown: (number | string)[]; page: { quick: boolean } } {
    const shown: (number | string)[] = [];
    const page = { quick: true };
    const nothing = (): void => undefined;
    const frame = ({ sequence }: { sequence: number }): void => {
      shown.push(sequence);
      if (page.quick) source.credit();
    };
    const message = (said: { type: string; source?: string }): void => void shown.push(said.source ?? said.type);
    const events = { open: nothing, lost: nothing, message, clock: nothing, nonsense: nothing, frame };
    const source = new RecordingSource(file as unknown as Recording, events, begin);
    return { file, source, shown, page };
  }

  it('plays on at the end of what is being written, also while its last frame is still being shown', async () => {
    const { file, source, shown, page } = playing();
    await source.told(told(file, 'recording'));
    await vi.advanceTimersByTimeAsync(150);
    expect(shown).toEqual([0, 1]);
    page.quick = false;
    await vi.advanceTimersByTimeAsync(1000);
    expect(shown).toEqual([0, 1, 2]);
    expect(source.position).toBe(200);
    expect(source.playing).toBe(true);
    page.quick = true;
    source.credit();
    expect(source.playing).toBe(true);

    file.written = 6;
    await source.told(told(file, 'writing its end'));
    await vi.advanceTimersByTimeAsync(1000);
    expect(shown).toEqual([0, 1, 2, 3, 4, 5]);
    expect(source.playing).toBe(true);
    file.written = 8;
    await source.told(told(file, 'off'));
    expect(source.playing).toBe(true);
    await vi.advanceTimersByTimeAsync(1000);
    expect(shown).toEqual([0, 1, 2, 3, 4, 5, 6, 7]);
    expect(source.playing).toBe(false);
  });

  it('says what describes the frames before the first of them, and only where that changes', async () => {
    const file = new Growing();
    file.infos = new Map([[0, { source: 'one' }], [kStepMs, { source: 'other' }]]);
    const { source, shown } = playing(file);
    await vi.advanceTimersByTimeAsync(1000);
    expect(shown).toEqual(['one', 0, 'other', 1, 2]);
    source.seek(0);
    await vi.advanceTimersByTimeAsync(50);
    expect(shown.slice(5)).toEqual(['one', 0]);
  });

  it.each(['at its end', 'as its last frame is being shown'])('goes on from where somebody jumps to %s', async (when) => {
    const { file, source, shown, page } = playing();
    await source.told(told(file, 'recording'));
    await vi.advanceTimersByTimeAsync(150);
    page.quick = when === 'at its end';
    await vi.advanceTimersByTimeAsync(1000);
    source.seek(Infinity); // there it is already: it does not begin again
    expect(source.position).toBe(200);
    expect(source.playing).toBe(true);
    source.seek(kStepMs);
    page.quick = true;
    source.credit();
    await vi.advanceTimersByTimeAsync(50);
    expect(source.position).toBeGreaterThan(kStepMs);
    expect(shown.at(-1)).toBe(1);
    await vi.advanceTimersByTimeAsync(1000);
    expect(shown.at(-1)).toBe(2);
    expect(source.playing).toBe(true);
  });

  it('is at the frame that was captured at a time of day, or plays from its start where it has none', async () => {
    const { source, shown } = playing(new Growing(), { atMs: kStepMs - 40, utc: true, playing: false });
    await vi.advanceTimersByTimeAsync(1000);
    expect([shown, source.position, source.playing]).toEqual([[1], kStepMs, false]);
    const other = playing(new Growing(), { atMs: 1e12, utc: true, playing: false });
    await vi.advanceTimersByTimeAsync(1000);
    expect(other.shown).toEqual([0, 1, 2]);
  });
});
