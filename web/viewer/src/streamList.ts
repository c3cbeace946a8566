// SPDX-License-Identifier: Apache-2.0
// What the server has to show, asked for again and again.
import { fetchList, takeList } from './early';
import type { ListedStream } from './protocol';
import { text } from './strings';

const kEveryMs = 2000;

/** `base`: the address of the server's page. */
export class ServerList {
  streams: readonly ListedStream[] = [];
  hint = ''; // a command to type where there are none
  /** The last list arrived. */
  arrived = false;
  /** It did not, since the server lets nobody in without a token. */
  wantsToken = false;
  private failed = false;
  private nextAt = 0;

  constructor(private readonly base: string = document.baseURI) {}

  /** Asks where it is time for it. True where what it knows has changed, or the server does not answer any more. */
  async refresh(): Promise<boolean> {
    const now = performance.now();
    if (now < this.nextAt || document.hidden) return false;
    this.nextAt = now + kEveryMs;
    try {
      const early = this.base === document.baseURI ? takeList() : null;
      ({ streams: this.streams, hint: this.hint } = await (early ?? fetchList(this.base)));
      this.arrived = true;
      this.wantsToken = false;
    } catch (error) {
      this.arrived = false;
      this.wantsToken = (error as Error).cause === 401;
    }
    this.failed = !this.arrived;
    return true;
  }

  /** At the next refresh(). */
  retryNow(): void {
    this.nextAt = 0;
  }

  /** Until the next attempt after one that failed; else null. */
  get retryInS(): number | null {
    return this.failed ? Math.ceil(Math.max(0, this.nextAt - performance.now()) / 1000) : null;
  }

  /** Why what is listed may not be so now, in words; empty: it is. `offline`: as the caller knows. */
  whyUnknown(offline: boolean): string {
    if (this.wantsToken) return text.streams.notTold;
    return this.arrived && !offline ? '' : text.streams.notKnown;
  }

  find(name: string | null): ListedStream | undefined {
    return this.streams.find((s) => s.name === name);
  }
}
