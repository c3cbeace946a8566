// SPDX-License-Identifier: Apache-2.0
// What the page starts before the code that uses it is loaded: workers, the list of streams, the connection. Whoever uses
// one takes it, and hears what it has said meanwhile.
import type { StreamList } from './protocol';

const kListPatienceMs = 5000;

interface Held {
  readonly target: EventTarget;
  readonly said: Event[];
  readonly keep: (event: Event) => void;
}

const kKinds = ['open', 'message', 'error', 'close'];
const held = new Map<string, Held>();

/** From now on, until someone takes it by this name. */
export function hold(name: string, target: EventTarget): void {
  const said: Event[] = [];
  const keep = (event: Event): void => void said.push(event);
  for (const kind of kKinds) target.addEventListener(kind, keep);
  held.set(name, { target, said, keep });
}

/** Null: there is none, or it was taken before. What it has said so far comes when the caller's task is done. */
export function take<Target extends EventTarget>(name: string): Target | null {
  const taken = held.get(name);
  if (taken === undefined) return null;
  held.delete(name);
  for (const kind of kKinds) taken.target.removeEventListener(kind, taken.keep);
  queueMicrotask(() => {
    for (const event of taken.said) taken.target.dispatchEvent(event);
  });
  return taken.target as Target;
}

/** What has not been taken is ended. */
export function endHeld(): void {
  for (const { target } of held.values()) {
    if (target instanceof WebSocket) target.close();
    else if (target instanceof Worker) target.terminate();
  }
  held.clear();
}

/** Throws where the server does not answer in time, or with something else, whose status is the error's cause. `server`: the address of its page. */
export async function fetchList(server: string): Promise<StreamList> {
  const response = await fetch(urlOf('api/streams', server), { cache: 'no-store', signal: AbortSignal.timeout(kListPatienceMs) });
  if (!response.ok) throw new Error(`HTTP ${response.status}`, { cause: response.status });
  return (await response.json()) as StreamList;
}

let list: Promise<StreamList> | null = null; // of the server that the page is of

export function holdList(asked: Promise<StreamList>): void {
  list = asked;
  asked.catch(() => undefined); // told by who takes it
}

export function takeList(): Promise<StreamList> | null {
  const taken = list;
  list = null;
  return taken;
}

/** Of something of a server. Of another site than the page's it gets no cookie: the token in the address of its page goes along. */
function urlOf(path: string, server: string): URL {
  const url = new URL(path, server);
  const token = new URL(server).searchParams.get('token');
  if (token !== null) url.searchParams.set('token', token);
  return url;
}

/** Where a stream is. `server`: the address of its page. */
export const streamUrl = (stream: string, server: string): URL => urlOf(`ws/${encodeURIComponent(stream)}`, server);

/** Of its WebSocket. */
export function socketUrl(stream: string, server: string): string {
  const url = streamUrl(stream, server);
  url.protocol = url.protocol === 'https:' ? 'wss:' : 'ws:';
  return url.href;
}

export function openSocket(url: string): WebSocket {
  const socket = new WebSocket(url);
  socket.binaryType = 'arraybuffer';
  return socket;
}
