// SPDX-License-Identifier: Apache-2.0
// The whole chain as a person sees it: `relievo-server serve` on the simulated face, and the viewer in headless Chromium.
// Run as: in_own_domain node serve_test.mjs RELIEVO_SERVER [SCREENSHOT], in web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { createInterface } from 'node:readline';
import { eventually, kPatienceMs, launchChromium } from './chromium.mjs';
import { loadsOf } from './web.mjs';

const kFirstPictureBytes = 300_000; // gzipped
const [serverPath, screenshot] = process.argv.slice(2);

const domain = process.env.RELIEVO_TEST_DOMAIN;
assert.ok(domain, 'RELIEVO_TEST_DOMAIN is not set: run this through in_own_domain');
const serve = (source, web) =>
  spawn(
    serverPath,
    // All lines, however busy this machine is.
    ['serve', '--source', source, '--stream', 'face', '--decoder', 'quick', '--web', web, '--domain', domain, '--interface', 'lo'],
    { stdio: ['ignore', 'pipe', 'inherit'] },
  );
const server = serve('sim:face', '127.0.0.1:0');
let next;
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
  const loads = loadsOf(page);
  const begin = Date.now();
  await page.goto(address);
  const look = () => page.evaluate(async () => ({ ...window.relievo.diagnostics(), pixels: await window.relievo.readPixels() }));
  const shownPast = (count) => page.waitForFunction((least) => window.relievo?.diagnostics().shown >= least, count);
  await shownPast(1);
  console.log(`first picture ${Date.now() - begin} ms after the page was asked for`);
  const loaded = await loads();
  const bytes = [...loaded.values()].reduce((sum, of) => sum + of, 0);
  console.log(`${bytes} bytes gzipped until then`);
  assert.ok(bytes > 50_000 && bytes < kFirstPictureBytes, `${bytes} bytes`);
  assert.deepEqual([...loaded.keys()].filter((url) => /draco/i.test(url)), [], 'Draco is loaded where nothing needs it');

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
    const { vertices } = window.relievo?.diagnostics() ?? {};
    return vertices > 0.3 * full && vertices < 0.7 * full;
  }, second.vertices);
  const reduced = await look();
  assert.equal(reduced.errors, 0, reduced.lastError);
  assert.ok(reduced.pixels.covered > 0.15, `the reduced surface covers ${reduced.pixels.covered} of the page`);
  let clients;
  await eventually(() => `clients of ${JSON.stringify(clients)}`, async () => {
    [{ clients_of: clients }] = (await (await page.request.get(new URL('/api/streams', address).href)).json()).streams;
    return clients.full === 0 && clients.reduced === 1 && clients.texture === 0; // it may miss the page before later
  });
  console.log(`${second.vertices} vertices in full, ${reduced.vertices} reduced`);

  // The menu: by keys alone, told in words, and kept by address and link.
  await page.goto(address);
  await shownPast(1);
  const told = (pattern) => page.waitForFunction((p) => new RegExp(p).test(document.querySelector('#quality-why')?.textContent), pattern);
  const now = (rung) => page.waitForFunction((r) => window.relievo.diagnostics().quality.now === r, rung);
  await page.keyboard.press('b');
  await told('^Full comes: nothing else was asked for');
  const offered = () => page.evaluate(() => [...document.querySelectorAll('#quality option')].map((o) => o.value));
  await page.waitForFunction(() => document.querySelectorAll('#quality option').length === 4);
  assert.deepEqual(await offered(), ['auto', 'full', 'reduced', 'texture']);
  assert.equal(await page.getByLabel('Quality').getAttribute('aria-describedby'), 'quality-why');
  await page.focus('#quality');
  await page.keyboard.press('ArrowDown');
  await now('reduced');
  await told('^Reduced comes, as chosen');
  assert.match(page.url(), /\?stream=face&quality=reduced$/);
  assert.match(await page.evaluate(() => window.relievo.link()), /\?stream=face&quality=reduced#/);
  await page.selectOption('#quality', 'texture');
  await now('texture');
  await page.waitForFunction(() => document.body.classList.contains('picture-alone'));
  await page.waitForFunction(() => {
    const { width, height } = document.querySelector('#picture');
    return document.querySelector('#picture').getContext('2d').getImageData(0, 0, width, height).data.some((v) => v > 60 && v < 250);
  });
  await page.keyboard.press('Escape');
  await page.keyboard.press('i');
  await page.waitForFunction(() => /qualityPicture alone comes, as chosen/.test(document.querySelector('#panel-statistics')?.textContent));
  await page.keyboard.press('b');
  await page.selectOption('#quality', 'auto');
  await now('full');
  await told('^Full comes: this page can follow');
  await page.waitForFunction(() => !document.body.classList.contains('picture-alone') && window.relievo.diagnostics().vertices > 10_000);
  // So busy that the page is slower than any server, also one that a loaded machine leaves little of itself: a frame
  // takes it over 3 s, as long as one that is in the background seems to.
  await page.evaluate(() => {
    const busy = () => {
      for (const end = performance.now() + 1600; performance.now() < end; );
      window.busy = setTimeout(busy, 5);
    };
    busy();
  });
  await page.waitForFunction(() => window.relievo.diagnostics().quality.now !== 'full');
  await told('comes: this page or its network could not follow more');
  await page.evaluate(() => clearTimeout(window.busy));
  assert.equal((await look()).errors, 0, (await look()).lastError);
  console.log('the menu chooses the quality, and says which one comes and why');

  server.kill('SIGINT');
  assert.deepEqual(await exited, { code: 0, signal: null });
  await page.waitForFunction(() => window.relievo.diagnostics().state !== 'live');
  console.log('the viewer says so when the server has gone');

  const pose = () => page.evaluate(() => window.relievo.pose());
  // Each drawing may round anew.
  const isOther = (a, b) => ['position', 'target'].some((of) => a[of].some((c, i) => Math.abs(c - b[of][i]) > 1e-6));
  await page.focus('#view');
  await page.keyboard.press('ArrowLeft');
  await page.waitForFunction(() => !window.relievo.diagnostics().busy);
  const before = await pose();
  for (const [source, isAnother] of [['sim:face', false], ['sim:walk', true]]) {
    const { shown } = await look();
    next = serve(source, new URL(address).host);
    await shownPast(shown + 2);
    assert.equal(isOther(await pose(), before), isAnother, `the view of ${source}, from where the face was seen`);
    next.kill('SIGKILL');
    await page.waitForFunction(() => window.relievo.diagnostics().state !== 'live');
  }
  console.log('the view is kept where the stream comes back, and set anew where another scene does');
} finally {
  await browser?.close();
  server.kill('SIGKILL');
  next?.kill('SIGKILL');
}
