// SPDX-License-Identifier: Apache-2.0
// What a player's src is of.
import { text } from '../../viewer/src/strings';

/** Its name at a server. */
export function fileOf({ pathname }: URL): string {
  const name = pathname.slice(pathname.lastIndexOf('/') + 1);
  try {
    return decodeURIComponent(name);
  } catch {
    return name; // '%' as it stands
  }
}

/** What a src is of: a stream of the gateway whose page `url` is, or, `stream` null, the recording at `url`. Throws. */
export function addressed(src: string): { url: URL; stream: string | null } {
  if (!URL.canParse(src, document.baseURI)) throw new Error(text.player.noAddress);
  const url = new URL(src, document.baseURI);
  url.hash = '';
  if (/\.mcap$/i.test(url.pathname)) return { url, stream: null };
  const stream = url.searchParams.get('stream') ?? '';
  const recording = url.searchParams.get('recording') ?? '';
  if (stream !== '') return { url, stream };
  if (recording === '') throw new Error(text.player.noStream);
  const at = new URL(`recordings/${encodeURIComponent(recording)}`, url); // as the viewer's own page has it
  const token = url.searchParams.get('token');
  if (token !== null) at.searchParams.set('token', token);
  return { url: at, stream: null };
}
