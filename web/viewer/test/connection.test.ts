// SPDX-License-Identifier: Apache-2.0
// Proves: a connection is kept over a line on which frames take long, and is given up where nothing comes any more.
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

  it('waits for a frame that takes as long as the server gives it', async () => {
    const [socket] = Socket.made;
    socket!.open();
    for (let frames = 1; frames <= 3; ++frames) {
      await wait(20);
      socket!.onmessage!({ data: new ArrayBuffer(0) });
      expect(events.lost).not.toHaveBeenCalled();
    }
    expect(Socket.made).toHaveLength(1);
  });

  it('begins anew where nothing comes for longer', async () => {
    Socket.made[0]!.open();
    await wait(32);
    expect(events.lost).toHaveBeenCalledOnce();
    expect(Socket.made).toHaveLength(2);
    expect(Socket.made[0]!.close).toHaveBeenCalled();
  });

  it('waits less for one that does not open', async () => {
    await wait(14);
    expect(Socket.made).toHaveLength(2);
  });
});
