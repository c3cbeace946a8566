// SPDX-License-Identifier: Apache-2.0
// Proves: a connection on which nothing comes is given up, soon at first, and kept over a line on which frames take long.
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { Connection } from '../src/connection';

class Socket {
  static readonly OPEN = 1;
  static made: Socket[] = [];
  readyState = 0;
  onopen: (() => void) | null = null;
  onmessage: ((event: { data: unknown }) => void) | null = null;
  onclose: (() => void) | null = null;
  close = vi.fn();
  send = vi.fn();

  constructor() {
    Socket.made.push(this);
  }

  open(): void {
    this.readyState = Socket.OPEN;
    this.onopen!();
  }
}

describe('Connection', () => {
  let connection: Connection;
  const events = { open: vi.fn(), lost: vi.fn(), message: vi.fn(), frame: vi.fn(), clock: vi.fn(), nonsense: vi.fn() };
  const wait = (seconds: number): Promise<unknown> => vi.advanceTimersByTimeAsync(seconds * 1000);

  beforeEach(() => {
    vi.useFakeTimers();
    vi.stubGlobal('window', globalThis);
    vi.stubGlobal('document', { baseURI: 'http://server/' });
    vi.stubGlobal('WebSocket', Socket);
    vi.stubGlobal('fetch', async () => ({ status: 426 }));
    vi.clearAllMocks();
    Socket.made = [];
    connection = new Connection('face', events);
  });
  afterEach(() => {
    connection.stop();
    vi.useRealTimers();
    vi.unstubAllGlobals();
  });

  const frame = { data: new ArrayBuffer(0) };

  it('gives one up on which nothing comes, as a line that was cut leaves it', async () => {
    Socket.made[0]!.open();
    await wait(1);
    Socket.made[0]!.onmessage!(frame);
    await wait(14);
    expect(events.lost).toHaveBeenCalledOnce();
    expect(Socket.made).toHaveLength(2);
    expect(Socket.made[0]!.close).toHaveBeenCalled();
  });

  it('then waits for frames that take as long as the server gives them', async () => {
    Socket.made[0]!.open();
    await wait(14);
    const [, socket] = Socket.made;
    socket!.open();
    for (let frames = 1; frames <= 3; ++frames) {
      await wait(22);
      socket!.onmessage!(frame);
      await wait(1);
    }
    expect(events.lost).toHaveBeenCalledOnce();
    await wait(32);
    expect(events.lost).toHaveBeenCalledTimes(2);
  });

  it('waits less for one that does not open', async () => {
    await wait(14);
    expect(Socket.made).toHaveLength(2);
  });
});
