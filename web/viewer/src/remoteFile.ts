// SPDX-License-Identifier: Apache-2.0
// A file of the server, read in parts: what is asked for comes in blocks, of which the last ones are kept, and the
// next one is fetched ahead. It may grow there meanwhile.
import type { Bytes } from './mcap';
import { Final, NoAnswer, NoToken, Unavailable } from './missing';

export const kBlock = 2 ** 18; // bytes
const kKept = 64; // blocks
const kTries = 4;
const kPatienceMs = 16_000; // while nothing of a part comes: a gateway gives up after 15 s
const kFirstWaitMs = 300; // before a second try; twice as long before each further one
const kLongestLine = 300; // letters
const kChanged = 'the recording has changed on the server: open it anew';

export type Fetch = (url: URL, init: RequestInit) => Promise<Response>;

export class RemoteFile implements Bytes {
  readonly isRemote = true;
  private readonly blocks = new Map<number, Promise<Uint8Array>>(); // the one used last is the last
  private readonly asking = new Set<AbortController>(); // parts that have not come

  private constructor(
    private readonly url: URL,
    private size_: number,
    private etag: string,
    private readonly fetch: Fetch,
  ) {}

  /** Whether the server says that more is being written behind it. */
  get isGrowing(): boolean {
    return this.etag.startsWith('"growing-');
  }

  /** Whether what wrote it did not come to its end. */
  get isCut(): boolean {
    return this.etag.startsWith('"cut-');
  }

  get size(): number {
    return this.size_;
  }

  /** Throws where the server has no such file, or does not give parts of it. */
  static async open(url: URL, by: Fetch = (at, init) => window.fetch(at, init)): Promise<RemoteFile> {
    let fetch: Fetch = (at, init) =>
      by(at, { cache: 'no-store', signal: AbortSignal.timeout(kPatienceMs), ...init }).catch(() => {
        throw new NoAnswer();
      });
    const first: RequestInit = { headers: { Range: 'bytes=0-0' } };
    let head = await fetch(url, first);
    if (head.status === 401 && url.origin !== window.location.origin) {
      // Of another site a person's token is sent where that site wants one.
      const ask = fetch;
      fetch = (at, init) => ask(at, { ...init, credentials: 'include' });
      head = await fetch(url, first);
    }
    if (head.status === 416) throw new Error('it is empty: what recorded it ended before the first frame');
    const told = head.status === 503 ? await lineOf(head) : '';
    if (told !== '') throw new Unavailable(told);
    const { size, etag } = versionOf(head);
    return new RemoteFile(url, size, etag, fetch);
  }

  async grow(end: number): Promise<void> {
    // One byte says how much there is now. The rest is read where it is needed.
    const headers = { Range: `bytes=${end}-${end}`, 'If-None-Match': this.etag };
    const head = await this.fetch(this.url, { headers });
    if (head.status === 304) return;
    if (head.status !== 206) await head.body?.cancel();
    if (head.status === 200) throw new Final(kChanged);
    ({ size: this.size_, etag: this.etag } = versionOf(head));
    for (const index of [...this.blocks.keys()]) {
      if ((index + 1) * kBlock > end) this.blocks.delete(index);
    }
  }

  async read(at: number, length: number): Promise<Uint8Array> {
    const end = Math.min(this.size, at + length);
    if (end <= at) return new Uint8Array();
    const [first, last] = [Math.floor(at / kBlock), Math.floor((end - 1) / kBlock)];
    const wanted = Array.from({ length: last - first + 1 }, (_, i) => this.block(first + i));
    if ((last + 1) * kBlock < this.size) this.block(last + 1).catch(() => undefined); // asked for again when needed
    const blocks = await Promise.all(wanted);
    if (blocks.length === 1) return blocks[0]!.slice(at - first * kBlock, end - first * kBlock);
    const out = new Uint8Array(end - at);
    blocks.forEach((block, i) => {
      const begin = (first + i) * kBlock;
      const part = block.subarray(Math.max(0, at - begin), end - begin);
      out.set(part, Math.max(0, begin - at));
    });
    return out;
  }

  /** Of the blocks that are kept, or fetched by itself and not kept. */
  async readLittle(at: number, length: number): Promise<Uint8Array> {
    const end = Math.min(this.size, at + length);
    if (end <= at) return new Uint8Array();
    const [first, last] = [Math.floor(at / kBlock), Math.floor((end - 1) / kBlock)];
    const kept = first === last ? this.blocks.get(first) : undefined;
    if (kept === undefined) return this.ask(at, end);
    return (await kept).slice(at - first * kBlock, end - first * kBlock);
  }

  /** What has not come is asked for anew, behind what is asked for now: connections are few. */
  giveUp(): void {
    for (const asking of this.asking) asking.abort();
  }

  private block(index: number): Promise<Uint8Array> {
    let block = this.blocks.get(index);
    this.blocks.delete(index);
    if (block === undefined) {
      block = this.load(index);
      const asked = block;
      block.catch(() => {
        if (this.blocks.get(index) === asked) this.blocks.delete(index);
      });
    }
    this.blocks.set(index, block);
    for (const oldest of this.blocks.keys()) {
      if (this.blocks.size <= kKept) break;
      this.blocks.delete(oldest);
    }
    return block;
  }

  private async load(index: number): Promise<Uint8Array> {
    const [at, end] = [index * kBlock, Math.min(this.size, (index + 1) * kBlock)];
    for (let tried = 1; ; ++tried) {
      try {
        return await this.ask(at, end);
      } catch (error) {
        if (error instanceof Final || error instanceof NoToken || tried === kTries) throw error;
        await new Promise((resolve) => setTimeout(resolve, kFirstWaitMs * 2 ** (tried - 1)));
      }
    }
  }

  private async ask(at: number, end: number): Promise<Uint8Array> {
    const asking = new AbortController();
    let heard = 0;
    const hear = (): void => {
      const now = ++heard;
      AbortSignal.timeout(kPatienceMs).addEventListener('abort', () => now === heard && asking.abort());
    };
    hear();
    this.asking.add(asking);
    try {
      return await this.askUntil(asking.signal, hear, at, end);
    } finally {
      this.asking.delete(asking);
    }
  }

  /** `hear` is called whenever something of it has come. */
  private async askUntil(signal: AbortSignal, hear: () => void, at: number, end: number): Promise<Uint8Array> {
    const headers = { Range: `bytes=${at}-${end - 1}`, 'If-Range': this.etag };
    const response = await this.fetch(this.url, { headers, signal });
    if (response.status === 200 || response.status === 416) {
      await response.body?.cancel();
      throw new Final(kChanged);
    }
    if (response.status !== 206) throw refused(response.status, 'the server does not give the recording');
    const bytes = await bodyOf(response, hear).catch(() => {
      throw new NoAnswer();
    });
    if (bytes.length !== end - at) throw new Unavailable('a part of the recording came short');
    return bytes;
  }
}

async function bodyOf({ body }: Response, hear: () => void): Promise<Uint8Array> {
  const parts: Uint8Array<ArrayBuffer>[] = [];
  for (const reader = body?.getReader(); ; hear()) {
    const { value } = (await reader?.read()) ?? {};
    if (value === undefined) return new Uint8Array(await new Blob(parts).arrayBuffer());
    parts.push(value);
  }
}

/** What a gateway says in a line of text; empty: the answer is another. */
async function lineOf(answer: Response): Promise<string> {
  if (answer.headers.get('content-type')?.startsWith('text/plain') !== true) return '';
  const text = (await answer.text().catch(() => '')).trim();
  return text.length > kLongestLine || text.includes('\n') ? '' : text;
}

function versionOf(head: Response): { size: number; etag: string } {
  const size = Number(/\/(\d+)$/.exec(head.headers.get('content-range') ?? '')?.[1]);
  const etag = head.headers.get('etag') ?? '';
  if (head.status !== 206) throw refused(head.status, 'the server does not give parts of it');
  if (!Number.isSafeInteger(size) || etag === '') {
    throw new Error('the server does not say which parts of it there are');
  }
  return { size, etag };
}

function refused(status: number, otherwise: string): Error {
  if (status === 401) return new NoToken();
  if (status === 404) return new Final('it is not there (HTTP 404)');
  const why = `${otherwise} (HTTP ${status})`;
  return status >= 500 || status === 429 ? new Unavailable(why) : new Final(why);
}
