// SPDX-License-Identifier: Apache-2.0
import { describe, expect, it } from 'vitest';

import { Credit } from '../src/credit';

/** Shows frames every so often; each came `comesIn` after it was asked for. */
function run(credit: Credit, frames: number, every: number, comesIn: number, waiting: (credit: Credit) => number): void {
  for (let i = 1, now = 1e6; i <= frames; ++i, now += every) {
    credit.asked(now);
    credit.came(now + comesIn);
    credit.shown(now + every, waiting(credit));
  }
}
const held = (credit: Credit): number => credit.frames - 1;

describe('frames under way', () => {
  it('are two where the page follows', () => {
    const credit = new Credit();
    run(credit, 100, 33, 5, held);
    expect(credit.frames).toBe(2);
  });

  it('is one where drawing takes long, and two again where it does not', () => {
    const credit = new Credit();
    run(credit, 10, 200, 5, held);
    expect(credit.frames).toBe(1);
    run(credit, 100, 200, 5, held);
    expect(credit.frames).toBe(1);
    run(credit, 10, 33, 5, held);
    expect(credit.frames).toBe(2);
  });

  it('are two where the way takes long: none waits for the page', () => {
    const credit = new Credit();
    run(credit, 100, 200, 190, () => 0);
    expect(credit.frames).toBe(2);
  });

  it('are two again where the way has become long', () => {
    const credit = new Credit();
    run(credit, 10, 200, 5, held);
    run(credit, 20, 200, 150, held);
    expect(credit.frames).toBe(2);
  });

  it('are as many more as a long way holds, once that is known, unless the page is slow', () => {
    const credit = new Credit();
    credit.frameRate = 30;
    credit.opened();
    credit.wentRound(900); // while the page was being loaded
    expect(credit.frames).toBe(2);
    credit.wentRound(100);
    credit.wentRound(350); // behind frames
    expect(credit.frames).toBe(5);
    run(credit, 100, 33, 100, () => 0);
    expect(credit.frames).toBe(5);
    run(credit, 10, 200, 5, () => 3);
    expect(credit.frames).toBe(1);
    run(credit, 20, 200, 150, () => 0);
    expect(credit.frames).toBe(5);
    credit.wentRound(0.4);
    expect(credit.frames).toBe(2);
    credit.opened(); // another way, perhaps
    credit.wentRound(10);
    credit.wentRound(5000);
    expect(credit.frames).toBe(7);
  });

  it('a pause of one frame says nothing', () => {
    const credit = new Credit();
    for (let i = 0; i < 20; ++i) {
      run(credit, 3, 33, 5, held);
      run(credit, 1, 500, 5, held);
    }
    expect(credit.frames).toBe(2);
  });
});
