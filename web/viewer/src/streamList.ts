// SPDX-License-Identifier: Apache-2.0
// What the server has to show, asked for again and again.
import type { ListedStream, StreamList } from './protocol';

const kEveryMs = 2000;
const kPatienceMs = 5000;

/** `base`: the address of the server's page. */
export class ServerList {
  streams: readonly ListedStream[] = [];
  hint = ''; // a command to type where there are none
  /** The last list arrived. */
  arrived = false;
  private failed = false;
  private readonly url: URL;
  private nextAt = 0;

  constructor(base: string = document.baseURI) {
    this.url = new URL('api/streams', base);
  }

  /** Asks where it is time for it. True where what it knows has changed, or the server does not answer any more. */
  async refresh(): Promise<boolean> {
    const now = performance.now();
    if (now < this.nextAt || document.hidden) return false;
    this.nextAt = now + kEveryMs;
    try {
      const response = await fetch(this.url, {
        cache: 'no-store',
        signal: AbortSignal.timeout(kPatienceMs),
      });
      if (!response.ok) throw new Error(`HTTP ${response.status}`);
      ({ streams: this.streams, hint: this.hint } = (await response.json()) as StreamList);
      this.arrived = true;
    } catch {
      this.arrived = false;
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

  find(name: string | null): ListedStream | undefined {
    return this.streams.find((s) => s.name === name);
  }
}
