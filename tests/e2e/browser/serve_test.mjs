// SPDX-License-Identifier: Apache-2.0
// The whole chain as a person sees it: `relievo-server serve` on the simulated face, and the viewer in headless Chromium.
// Run as: in_own_domain node serve_test.mjs RELIEVO_SERVER [SCREENSHOT], in web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { createInterface } from 'node:readline';
import { kPatienceMs, launchChromium } from './chromium.mjs';

const [serverPath, screenshot] = process.argv.slice(2);

const domain = process.env.RELIEVO_TEST_DOMAIN;
assert.ok(domain, 'RELIEVO_TEST_DOMAIN is not set: run this through in_own_domain');
const server = spawn(
  serverPath,
  ['serve', '--source', 'sim:face', '--web', '127.0.0.1:0', '--domain', domain, '--interface', 'lo'],
  { stdio: ['ignore', 'pipe', 'inherit'] },
);
const exited = new Promise((resolve) => server.once('exit', (code, signal) => resolve({ code, signal })));
let browser;
try {
  const address = await new Promise((resolve, reject) => {
    createInterface({ input: server.stdout }).on('line', (line) => {
      if (line.startsWith('viewer ')) resolve(line.slice('viewer '.length));
    });
    exited.then(({ code }) => reject(new Error(`the server ended with status ${code} before it served`)));
  });

  browser = await launchChromium();
  const complaints = [];
  const page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
  page.setDefaultTimeout(kPatienceMs);
  page.on('pageerror', (error) => complaints.push(error.message));
  const begin = Date.now();
  await page.goto(address);
  const look = () => page.evaluate(() => ({ ...window.relievo.diagnostics(), pixels: window.relievo.readPixels() }));
  const shownPast = (count) => page.waitForFunction((least) => window.relievo.diagnostics().shown >= least, count);
  await shownPast(1);
  console.log(`first picture ${Date.now() - begin} ms after the page was asked for`);

  const first = await look();
  await shownPast(first.shown + 5);
  await page.waitForFunction(() => window.relievo.diagnostics().state === 'live');
  const second = await look();
  assert.ok(second.vertices > 10_000, `${second.vertices} vertices`);
  assert.ok(second.pixels.covered > 0.15, `the surface covers ${second.pixels.covered} of the page`);
  assert.ok(second.pixels.deviation > 10, `the picture is flat: ${second.pixels.deviation}`);
  assert.notEqual(second.pixels.hash, first.pixels.hash, 'the picture does not move');
  assert.ok(second.frame > first.frame, 'the frame counter stands still');
  assert.equal(second.errors, 0, second.lastError);
  assert.deepEqual(complaints, []);
  const health = await page.request.get(new URL('/healthz', address).href);
  assert.equal(health.status(), 200);
  if (screenshot) await page.screenshot({ path: screenshot });

  const modest = new URL(address);
  modest.searchParams.set('quality', 'reduced');
  await page.goto(modest.href);
  await page.waitForFunction((full) => {
    const { vertices } = window.relievo.diagnostics();
    return vertices > 0.3 * full && vertices < 0.7 * full;
  }, second.vertices);
  const reduced = await look();
  assert.equal(reduced.errors, 0, reduced.lastError);
  assert.ok(reduced.pixels.covered > 0.15, `the reduced surface covers ${reduced.pixels.covered} of the page`);
  const { streams } = await (await page.request.get(new URL('/api/streams', address).href)).json();
  assert.deepEqual(streams[0].clients_of, { full: 0, reduced: 1, texture: 0 });
  console.log(`${second.vertices} vertices in full, ${reduced.vertices} reduced`);

  server.kill('SIGINT');
  assert.deepEqual(await exited, { code: 0, signal: null });
  await page.waitForFunction(() => window.relievo.diagnostics().state !== 'live');
  console.log('the viewer says so when the server has gone');
} finally {
  await browser?.close();
  server.kill('SIGKILL');
}
