// SPDX-License-Identifier: Apache-2.0
// What a person takes away: files and the clipboard.
import { make } from './dom';

export function download(name: string, content: Blob): void {
  const url = URL.createObjectURL(content);
  make('a', { href: url, download: name }).click();
  window.setTimeout(() => URL.revokeObjectURL(url), 10_000); // the browser may still be reading
}

/** Also on plain http, where the clipboard's own interface is missing. False where the browser refuses. */
export async function copy(text: string): Promise<boolean> {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    const focused = document.activeElement;
    const area = make('textarea', { value: text });
    document.body.append(area);
    area.select();
    const done = document.execCommand('copy');
    area.remove();
    if (focused instanceof HTMLElement) focused.focus(); // keys go on from where they were
    return done;
  }
}

const kMostOfName = 64; // letters, as of a stream: systems allow 255 bytes for all of a name

/** "relievo-face-000123.ply". `shown`: a stream, or the name of a file, in any script. */
export function fileName(shown: string | null, number: number | null, extension: string): string {
  const bare = (shown ?? '').replace(/\.(mcap|ply|glb)$/i, '').normalize();
  const letters = Array.from(bare.replace(/[^\p{L}\p{M}\p{N}_.-]+/gu, '_')).slice(0, kMostOfName);
  const safe = letters.join('').replace(/^[_.]+|[_.]+$/g, '') || 'surface';
  const frame = number === null ? '' : `-${String(number).padStart(6, '0')}`;
  return `relievo-${safe}${frame}.${extension}`;
}
