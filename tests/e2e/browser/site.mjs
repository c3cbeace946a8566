// SPDX-License-Identifier: Apache-2.0
// Another site, which embeds <relievo-player>: the package as `npm pack` makes it, its files, its content policy, and what a page's player says and shows.
import { execFileSync } from 'node:child_process';
import { createReadStream, existsSync, statSync } from 'node:fs';
import { createServer } from 'node:http';
import { extname, join, normalize } from 'node:path';

const kTypes = { '.html': 'text/html', '.js': 'text/javascript', '.css': 'text/css', '.wasm': 'application/wasm' };
export const kPolicy =
  "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self'; worker-src 'self'; connect-src 'self' http://127.0.0.1:* ws://127.0.0.1:*";

/** Packs `packagePath` and unpacks it in `folder`/package; the files that it has. */
export function packed(packagePath, folder) {
  const listed = JSON.parse(execFileSync('npm', ['pack', '--json', '--pack-destination', folder], { cwd: packagePath, encoding: 'utf8', stdio: ['ignore', 'pipe', 'ignore'] }));
  execFileSync('tar', ['xzf', join(folder, listed[0].filename), '-C', folder]);
  return listed[0].files.map(({ path }) => path);
}

/** The files of a folder, with ranges, as a recording needs them; `headers`: beside its own. */
export function serveSite(site, headers = {}) {
  const server = createServer((request, response) => {
    const file = join(site, normalize(new URL(request.url, 'http://site').pathname));
    if (!existsSync(file) || !statSync(file).isFile()) return response.writeHead(404).end();
    const { size, mtimeMs } = statSync(file);
    const said = { 'content-type': kTypes[extname(file)] ?? 'application/octet-stream', 'content-security-policy': kPolicy, etag: `"${mtimeMs}"`, ...headers };
    const range = /^bytes=(\d+)-(\d+)$/.exec(request.headers.range ?? '');
    if (range === null) {
      response.writeHead(200, { ...said, 'content-length': size });
      createReadStream(file).pipe(response);
      return;
    }
    const [start, end] = [Number(range[1]), Math.min(Number(range[2]), size - 1)];
    response.writeHead(206, { ...said, 'content-length': end - start + 1, 'content-range': `bytes ${start}-${end}/${size}` });
    createReadStream(file, { start, end }).pipe(response);
  });
  return new Promise((resolve) => server.listen(0, '127.0.0.1', () => resolve(server)));
}

/** What `read` makes of the page's player. */
export const player = (page, read) => page.evaluate(`(${read})(document.querySelector('relievo-player'))`);

/** Opaque share of a picture that the player takes of itself, and a sum of its pixels. */
export const shot = (page) =>
  page.evaluate(async () => {
    const bitmap = await createImageBitmap(await document.querySelector('relievo-player').screenshot());
    const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d');
    context.drawImage(bitmap, 0, 0);
    const rgba = context.getImageData(0, 0, bitmap.width, bitmap.height).data;
    const opaque = rgba.filter((v, i) => i % 4 === 3 && v > 128).length / (bitmap.width * bitmap.height);
    return { opaque, sum: rgba.reduce((a, b) => a + b, 0) };
  });
