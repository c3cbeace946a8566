// SPDX-License-Identifier: Apache-2.0
// `relievo web` of a recording, in the test's DDS domain; a browser that lacks what the web has; what a page loads.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { gzipSync } from 'node:zlib';

/** `options` beside those for the network; stop() ends it. */
export async function startWeb(relievoPath, recorded, options = []) {
  const domain = process.env.RELIEVO_TEST_DOMAIN;
  assert.ok(domain, 'RELIEVO_TEST_DOMAIN is not set: run this through in_own_domain');
  const web = spawn(relievoPath, ['web', recorded, '--listen', '127.0.0.1:0', ...options, '--domain', domain], {
    stdio: ['ignore', 'pipe', 'inherit'],
  });
  const ended = new Promise((resolve) => web.once('exit', resolve));
  const said = await new Promise((resolve, reject) => {
    web.stdout.once('data', (data) => resolve(String(data)));
    web.once('exit', (code) => reject(new Error(`relievo web ended with ${code}`)));
  });
  const stop = async () => {
    web.kill('SIGTERM');
    await ended;
  };
  return { address: said.trim().replace('viewer ', ''), stop };
}

/** What `page` opens from now on finds no WebGL. */
export const withoutWebGl = (page) =>
  page.addInitScript(() => {
    for (const { prototype } of [HTMLCanvasElement, OffscreenCanvas]) {
      const original = prototype.getContext;
      prototype.getContext = function (kind, ...rest) {
        return String(kind).startsWith('webgl') ? null : original.call(this, kind, ...rest);
      };
    }
  });

/**
 * What `page` and its service worker ask for from now on until its first picture: the result, called behind that, gives the
 * gzipped bytes by address. What the page and its workers both ask for comes from the network once where the server says that
 * the browser may keep it.
 */
export function loadsOf(page) {
  const loads = [];
  page.context().on('response', (response) => loads.push(response)); // of its service worker, too: see chromium.mjs
  return async () => {
    const until = await page.evaluate(() => performance.timeOrigin + performance.getEntriesByName('first-picture')[0].startTime);
    const bytes = new Map();
    for (const response of loads) {
      if (response.request().timing().startTime > until) continue;
      const before = bytes.get(response.url()) ?? 0;
      if (before > 0 && /immutable/.test(response.headers()['cache-control'])) continue;
      bytes.set(response.url(), before + gzipSync(await response.body().catch(() => '')).length);
    }
    return bytes;
  };
}
