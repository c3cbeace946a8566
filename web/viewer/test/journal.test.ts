// SPDX-License-Identifier: Apache-2.0
// Proves: the stages of a frame add up from the exposure to the screen, whatever the clocks are apart.
import { describe, expect, it } from 'vitest';
import { Journal, kStages } from '../src/journal';
import type { FramePrefix } from '../src/protocol';

const kAhead = 5000; // the server's clock
const prefix = (sequence: number, captureMs: number): FramePrefix => ({
  bytes: 48,
  sequence,
  captureMs: captureMs + kAhead,
  publishMs: captureMs + kAhead + 20,
  sentMs: captureMs + kAhead + 22,
  drops: 0,
});
const nothing = new ArrayBuffer(48);

function live(journal: Journal, sequence: number, at: number): void {
  const p = prefix(sequence, at);
  journal.arrived(p, nothing, at + 30);
  journal.decoded(p, at + 41);
  journal.shown(p, at + 45, kAhead);
}

describe('Journal', () => {
  it('tells where the time goes', () => {
    const journal = new Journal();
    for (let i = 0; i < 5; ++i) live(journal, i, 1e12 + i * 33);
    const medians = journal.medians()!;
    expect(medians).toEqual({ server: 20, gateway: 2, network: 8, decode: 11, draw: 4 });
    expect(kStages.reduce((sum, stage) => sum + medians[stage], 0)).toBe(45);
  });

  it('leaves out recordings, frames it does not know, and the oldest', () => {
    const journal = new Journal();
    journal.shown(prefix(1, 1e12), 1e12 + 45, kAhead);
    const old = prefix(2, 1e12);
    journal.arrived(old, nothing, 1e12 + 1e7);
    journal.shown(old, 1e12 + 1e7, kAhead);
    expect(journal.medians()).toBeNull();
    for (let i = 0; i < 400; ++i) live(journal, 10 + i, 1e12 + i * 33);
    expect(journal.stages.length).toBe(150);
    expect(journal.parts).toBeNull(); // what is no frame has no parts
  });
});
