// SPDX-License-Identifier: Apache-2.0
// Proves: a file of the server reads as one of this device, in few requests, and never as a mixture of two.
import { describe, expect, it, vi } from 'vitest';
import { NoAnswer, Unavailable } from '../src/missing';
import { kBlock, RemoteFile, type Fetch } from '../src/remoteFile';

const url = new URL('http://host/recordings/a.mcap');

class Server {
  bytes = Uint8Array.from({ length: 3 * kBlock + 1234 }, (_, i) => (i * 31 + (i >> 8)) & 255);
  etag = '"one"';
  asked: string[] = [];
  failures = 0;

  readonly fetch: Fetch = async (_, init) => {
    const headers = new Headers(init.headers);
    const range = headers.get('range')!;
    this.asked.push(range);
    if (this.failures > 0) {
      --this.failures;
      throw new TypeError('network');
    }
    const condition = headers.get('if-range');
    if (condition !== null && condition !== this.etag) return new Response(this.bytes, { status: 200 });
    if (headers.get('if-none-match') === this.etag) return new Response(null, { status: 304 });
    const [from, to] = range.slice('bytes='.length).split('-').map(Number) as [number, number];
    const total = this.bytes.length;
    return new Response(this.bytes.slice(from, to + 1), {
      status: 206,
      headers: { 'content-range': `bytes ${from}-${to}/${total}`, etag: this.etag },
    });
  };
}

describe('RemoteFile', () => {
  it('reads what is there, across blocks and up to the end', async () => {
    const server = new Server();
    const file = await RemoteFile.open(url, server.fetch);
    expect(file.size).toBe(server.bytes.length);
    const places: [number, number][] = [[0, 10], [kBlock - 3, 6], [5, 2 * kBlock + 7], [kBlock, kBlock], [file.size - 5, 100], [file.size, 4]];
    for (const [at, length] of places) {
      expect(Buffer.compare(await file.read(at, length), server.bytes.slice(at, at + length)), `${at}+${length}`).toBe(0);
    }
  });

  it('asks for a block once, and for the next one ahead', async () => {
    const server = new Server();
    const file = await RemoteFile.open(url, server.fetch);
    for (let at = 0; at < kBlock; at += 1000) await file.read(at, 9);
    expect(server.asked.slice(1)).toEqual([`bytes=0-${kBlock - 1}`, `bytes=${kBlock}-${2 * kBlock - 1}`]);
  });

  it('tries again where the network fails', async () => {
    const server = new Server();
    const file = await RemoteFile.open(url, server.fetch);
    server.failures = 2;
    expect(await file.read(3 * kBlock, 4)).toEqual(server.bytes.slice(3 * kBlock, 3 * kBlock + 4));
  });

  it('says that the file has changed', async () => {
    const server = new Server();
    const file = await RemoteFile.open(url, server.fetch);
    server.etag = '"two"';
    await expect(file.read(0, 4)).rejects.toThrow('changed');
  });

  it('says at once that a token is wanted, where there is one since, and goes on once there is one', async () => {
    const server = new Server();
    let asked = 0;
    const file = await RemoteFile.open(url, async (at, init) => {
      if (server.etag !== '') return server.fetch(at, init);
      ++asked;
      return new Response('a token is wanted', { status: 401 });
    });
    server.etag = '';
    const error: unknown = await file.read(3 * kBlock, 4).catch((why: unknown) => why);
    expect([String(error).includes('sign in'), error instanceof Unavailable]).toEqual([true, true]);
    expect(asked).toBe(1);
    server.etag = '"one"';
    expect(await file.read(3 * kBlock, 4)).toEqual(server.bytes.slice(3 * kBlock, 3 * kBlock + 4));
  });

  it('waits no longer than a server does for what has stopped coming, and asks again', async () => {
    const server = new Server();
    const impatient = vi.spyOn(AbortSignal, 'timeout').mockImplementation((ms) => {
      expect(ms).toBeGreaterThan(15_000);
      const now = new AbortController();
      setTimeout(() => now.abort(), 20);
      return now.signal;
    });
    let stopped = 0;
    const file = await RemoteFile.open(url, async (at, init) => {
      const whole = await server.fetch(at, init);
      if (init.headers === undefined || stopped === 2 || !new Headers(init.headers).has('if-range')) return whole;
      const never = new Promise<void>((_, reject) => init.signal!.addEventListener('abort', () => reject(new DOMException('', 'AbortError'))));
      if (++stopped === 1) return never as never;
      return new Response(new ReadableStream({ start: (body) => (body.enqueue(new Uint8Array(99)), void never.catch((why) => body.error(why))) }), { status: 206 });
    });
    expect(await file.read(3 * kBlock, 4)).toEqual(server.bytes.slice(3 * kBlock, 3 * kBlock + 4));
    expect(stopped).toBe(2);
    impatient.mockRestore();
  });

  it('waits for all of what comes slowly', async () => {
    const impatient = vi.spyOn(AbortSignal, 'timeout').mockImplementation(() => {
      const now = new AbortController();
      setTimeout(() => now.abort(), 200);
      return now.signal;
    });
    const server = new Server();
    const file = await RemoteFile.open(url, async (at, init) => {
      const whole = await server.fetch(at, init);
      const bytes = new Uint8Array(await whole.arrayBuffer());
      const pieces = Array.from({ length: 10 }, (_, i) => bytes.slice((i * bytes.length) / 10, ((i + 1) * bytes.length) / 10));
      const body = new ReadableStream<Uint8Array>({
        pull: async (to) => {
          await new Promise((resolve) => setTimeout(resolve, 40));
          if (init.signal!.aborted) to.error(new DOMException('', 'AbortError'));
          else if (pieces.length === 0) to.close();
          else to.enqueue(pieces.shift()!);
        },
      });
      return new Response(body, { status: whole.status, headers: whole.headers });
    });
    server.asked = [];
    expect(await file.read(3 * kBlock, 4)).toEqual(server.bytes.slice(3 * kBlock, 3 * kBlock + 4));
    expect(server.asked).toHaveLength(1);
    impatient.mockRestore();
  });

  it('asks anew for what was given up, at once for what is wanted next', async () => {
    const server = new Server();
    let hang = true;
    const asked: string[] = [];
    const file = await RemoteFile.open(url, async (at, init) => {
      asked.push(new Headers(init.headers).get('range')!);
      if (!hang || !new Headers(init.headers).has('if-range')) return server.fetch(at, init);
      return new Promise((_, reject) => init.signal!.addEventListener('abort', () => reject(new DOMException('', 'AbortError')))) as never;
    });
    const waiting = file.read(3 * kBlock, 4);
    await Promise.resolve();
    hang = false;
    asked.length = 0;
    file.giveUp();
    expect(await file.read(0, 4)).toEqual(server.bytes.slice(0, 4));
    expect(await waiting).toEqual(server.bytes.slice(3 * kBlock, 3 * kBlock + 4));
    expect(asked.map((range) => Number(/=(\d+)/.exec(range)![1]) / kBlock)).toEqual([0, 1, 3]);
  });

  it('tells what may come later from what does not', async () => {
    for (const [status, passing] of [[503, true], [429, true], [404, false], [403, false]] as const) {
      const server = new Server();
      const file = await RemoteFile.open(url, server.fetch);
      const { fetch } = server;
      Object.assign(file, { fetch: async (at: URL, init: RequestInit) => (new Headers(init.headers).has('if-range') ? new Response('', { status }) : fetch(at, init)) });
      const error: unknown = await file.readLittle(3 * kBlock, 4).catch((why: unknown) => why);
      expect([String(error).includes(`HTTP ${status}`), error instanceof Unavailable]).toEqual([true, passing]);
    }
  });

  it('reads on where it has grown, anew only what may have changed', async () => {
    const server = new Server();
    const file = await RemoteFile.open(url, server.fetch);
    const end = 2 * kBlock + 100; // an index is behind it, which the next chunks take the place of
    await file.read(0, 3 * kBlock);
    await file.grow(end);
    expect(file.size).toBe(server.bytes.length);

    const before = server.bytes;
    server.bytes = Uint8Array.from({ length: 5 * kBlock }, (_, i) => (i < end ? before[i]! : (i * 7 + 3) & 255));
    server.etag = '"two"';
    await file.grow(end);
    expect(file.size).toBe(server.bytes.length);
    server.asked = [];
    expect(Buffer.compare(await file.read(0, 5 * kBlock), server.bytes)).toBe(0);
    expect(server.asked.map((range) => Number(/=(\d+)/.exec(range)![1]) / kBlock)).toEqual([2, 3, 4]);
  });

  it('stays as it is where it cannot grow', async () => {
    const server = new Server();
    const file = await RemoteFile.open(url, server.fetch);
    const { size } = file;
    server.failures = 1;
    await expect(file.grow(10)).rejects.toThrow(NoAnswer);
    const gone = await RemoteFile.open(url, async (_, init) => {
      const isAsked = new Headers(init.headers).has('if-none-match');
      return isAsked ? new Response('gone', { status: 404 }) : server.fetch(url, init);
    });
    await expect(gone.grow(10)).rejects.toThrow('HTTP 404');
    for (const one of [file, gone]) {
      expect(one.size).toBe(size);
      expect(await one.read(7, 4)).toEqual(server.bytes.slice(7, 11));
    }
  });

  it('is another where the server gives no part of it any more', async () => {
    const server = new Server();
    const file = await RemoteFile.open(url, async (_, init) => {
      const isAsked = new Headers(init.headers).has('if-none-match');
      return isAsked ? new Response('all of another one', { status: 200, headers: { etag: '"growing-1-2-3"' } }) : server.fetch(url, init);
    });
    await expect(file.grow(10)).rejects.toThrow('has changed on the server');
  });

  it('is not opened where the server gives no parts', async () => {
    await expect(RemoteFile.open(url, async () => new Response('all of it', { status: 200 }))).rejects.toThrow('HTTP 200');
    await expect(RemoteFile.open(url, async () => new Response('', { status: 404 }))).rejects.toThrow('it is not there (HTTP 404)');
    const told = new Response('the recording cannot be read: Permission denied\n', { status: 503, headers: { 'content-type': 'text/plain' } });
    await expect(RemoteFile.open(url, async () => told)).rejects.toThrow(/^the recording cannot be read: Permission denied$/);
    const page = new Response('<p>busy</p>', { status: 503, headers: { 'content-type': 'text/html' } });
    await expect(RemoteFile.open(url, async () => page)).rejects.toThrow('HTTP 503');
    const empty = new Response('', { status: 416, headers: { 'content-range': 'bytes */0', etag: '"1"' } });
    await expect(RemoteFile.open(url, async () => empty)).rejects.toThrow('it is empty');
  });
});
