// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium: the package that `npm pack` makes holds <relievo-player> with its types, and a page of
// another site with a strict content policy shows a live stream and a recording with it.
// Run as: in_own_domain node player_test.mjs RELIEVO_SERVER RELIEVO PACKAGE, in web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { eventually, kPatienceMs, launchChromium } from './chromium.mjs';
import { recordObject } from './recorded.mjs';
import { Server } from './server.mjs';
import { packed, player, serveSite, shot } from './site.mjs';

const { McapStreamReader } = createRequire(join(process.cwd(), 'package.json'))('@mcap/core');

const [serverPath, relievoPath, packagePath] = process.argv.slice(2);
const scratch = mkdtempSync(join(tmpdir(), 'relievo-player-'));
const site = join(scratch, 'site'); // what the other site serves
const kWorkers = 2; // of a player: one decodes, one draws

/** When a recording's frames were recorded, in nanoseconds. */
function frameTimes(file) {
  const reader = new McapStreamReader();
  reader.append(readFileSync(file));
  const out = [];
  for (let record = reader.nextRecord(); record !== undefined; record = reader.nextRecord())
    if (record.type === 'Message' && Buffer.from(record.data).includes('RLVF')) out.push(record.logTime);
  return out;
}

const kSource = 'sim:object,width=320,height=240,stripes=60,rate=6';
const files = packed(packagePath, scratch);
mkdirSync(site);
execFileSync('cp', ['-r', join(scratch, 'package'), join(site, 'relievo-player')]);
const web = await serveSite(site);
const origin = `http://127.0.0.1:${web.address().port}`;
const rig = await Server.start(serverPath, ['--source', kSource, '--key-interval', '5', '--allow-origin', origin]);
const folder = join(scratch, 'folder');
mkdirSync(folder);
const keeper = await Server.start(serverPath, ['--source', kSource, '--key-interval', '5', '--stream', 'kept', '--record-dir', folder, '--allow-origin', origin]);
writeFileSync(join(site, 'page.html'), '<!doctype html><title>Another site</title><script type="module" src="relievo-player/dist/relievo-player.js"></script><relievo-player controls></relievo-player>');
recordObject(serverPath, join(site, 'take.mcap'), { rate: 6, frames: 13, options: ['--stream', 'take', '--key-interval', '5'] });
const browser = await launchChromium();
const complaints = [];

const when = (page, condition) => eventually(`not: ${condition}`, () => player(page, condition));
const forget = (page) =>
  page.evaluate(() => {
    window.frames_ = [];
    const element = document.querySelector('relievo-player');
    element.addEventListener('frame', ({ detail }) => window.frames_.push(detail));
  });

const checks = {
  async 'the package holds what it says'() {
    for (const name of ['package.json', 'README.md', 'relievo-player.d.ts', 'dist/relievo-player.js', 'example/index.html']) {
      assert.ok(files.includes(name), `${name} is not in ${files}`);
    }
    const { main, types } = JSON.parse(readFileSync(join(scratch, 'package', 'package.json'), 'utf8'));
    assert.ok(files.includes(main) && files.includes(types));
    assert.ok(files.every((name) => !/\.map$|node_modules|src\//.test(name)), `${files}`);
    writeFileSync(join(scratch, 'use.ts'), `import './package/relievo-player';
const player = document.querySelector('relievo-player')!;
player.mode = 'depth';
player.addEventListener('frame', ({ detail }) => detail.vertices.toFixed());
const blob: Promise<Blob> = player.screenshot();
void blob;
`);
    execFileSync('node_modules/.bin/tsc', ['--noEmit', '--strict', '--target', 'es2022', '--lib', 'es2022,dom', '--typeRoots', join(scratch, 'none'), '--moduleResolution', 'bundler', '--module', 'esnext', join(scratch, 'use.ts')]);
  },

  async 'a live stream of another origin'(page) {
    assert.equal(await player(page, (p) => p.state), 'idle');
    await forget(page);
    await page.evaluate((src) => (document.querySelector('relievo-player').src = src), `${rig.address}/?stream=object`);
    await when(page, (p) => p.state === 'live' && p.duration > 1);
    await page.waitForFunction(() => window.frames_.length > 3);
    assert.ok(await page.evaluate(() => window.frames_.every(({ vertices, triangles }) => vertices > 1000 && triangles > 1000)));
    const textured = await shot(page);
    assert.ok(textured.opaque > 0.15, `covers ${textured.opaque}`);
    await page.evaluate(() => document.querySelector('relievo-player').pause());
    await when(page, (p) => p.state === 'behind' && p.paused);
    await page.evaluate(() => (document.querySelector('relievo-player').mode = 'normals'));
    assert.notEqual((await shot(page)).sum, textured.sum);
    await page.evaluate(() => (document.querySelector('relievo-player').currentTime = 0));
    await when(page, (p) => p.currentTime < 0.5);
    await page.evaluate(() => document.querySelector('relievo-player').goLive());
    await when(page, (p) => p.state === 'live');
  },

  async 'it is dark, light, or as the system is'(page) {
    const ground = (theme) =>
      page.evaluate((name) => {
        const element = document.querySelector('relievo-player');
        if (name === null) element.removeAttribute('theme');
        else element.setAttribute('theme', name);
        return Number(/\d+/.exec(getComputedStyle(element).backgroundColor)[0]);
      }, theme);
    assert.ok((await ground('light')) > 200);
    await page.emulateMedia({ colorScheme: 'light' });
    assert.ok((await ground('auto')) > 200);
    assert.ok((await ground('dark')) < 50);
    await page.emulateMedia({ colorScheme: 'dark' });
    assert.ok((await ground('auto')) < 50);
    assert.ok((await ground(null)) < 50);
  },

  async 'its time line, its keys, and none of the page\'s'(page) {
    assert.ok(await page.isVisible('relievo-player #timeline'));
    await page.click('relievo-player #timeline button[title^="Pause"]');
    await when(page, (p) => p.state === 'behind');
    await page.focus('relievo-player .view');
    await page.keyboard.press('6');
    assert.equal(await player(page, (p) => p.getAttribute('mode')), 'depth');
    await page.keyboard.press('l');
    await when(page, (p) => p.state === 'live');
    await page.evaluate(() => document.activeElement.blur());
    await page.keyboard.press('1');
    assert.equal(await player(page, (p) => p.mode), 'depth');
    await page.evaluate(() => (document.querySelector('relievo-player').controls = false));
    assert.equal(await page.isVisible('relievo-player #timeline'), false);
  },

  async 'a recording of the page\'s own site'(page) {
    await page.evaluate(() => (document.querySelector('relievo-player').src = 'take.mcap'));
    await when(page, (p) => p.state === 'file' && p.paused && p.duration > 1);
    const duration = await player(page, (p) => p.duration);
    const times = frameTimes(join(site, 'take.mcap'));
    const span = Number(times.at(-1) - times[0]) * 1e-9;
    assert.ok(Math.abs(duration - span) < 1e-3, `${duration} s, not ${span}`);
    assert.ok(Math.abs((await player(page, (p) => p.currentTime)) - duration) < 1e-3);
    await page.evaluate(() => {
      const element = document.querySelector('relievo-player');
      element.loop = true;
      window.frames_.length = 0;
      element.play();
    });
    await page.waitForFunction(() => window.frames_.some(({ number }, i) => i > 0 && number < window.frames_[i - 1].number));
    assert.equal(await player(page, (p) => p.paused), false);
  },

  async 'a recording of a gateway of another origin that is still writing it'(page) {
    const order = (action) =>
      fetch(`${keeper.address}/api/recording/kept`, { method: 'POST', body: JSON.stringify({ action }), headers: { 'content-type': 'application/json' } });
    const listed = async () => (await (await fetch(`${keeper.address}/api/recordings`)).json()).recordings[0];
    await eventually('the stream does not begin', async () => (await order('start')).ok);
    await eventually('the recording is not listed', async () => (await listed()) !== undefined);
    const { file } = await listed();
    await page.evaluate((src) => {
      const element = document.querySelector('relievo-player');
      element.loop = true; // that waits until it is whole
      element.src = src;
      window.durations_ = [];
      element.addEventListener('durationchange', () => window.durations_.push(element.duration));
    }, `${keeper.address}/recordings/${file}`);
    await when(page, (p) => p.state === 'file' && p.duration > 0);
    await page.evaluate(() => (document.querySelector('relievo-player').currentTime = 1e9));
    await page.evaluate(() => (window.first_ = document.querySelector('relievo-player').duration));
    await when(page, (p) => p.currentTime > window.first_ + 2 && !p.paused);
    await page.evaluate(() => (document.querySelector('relievo-player').loop = false));
    assert.ok((await order('stop')).ok);
    await when(page, (p) => p.paused);
    const times = frameTimes(join(folder, file));
    const { duration, currentTime } = await player(page, (p) => ({ duration: p.duration, currentTime: p.currentTime }));
    assert.ok(Math.abs(duration - Number(times.at(-1) - times[0]) * 1e-9) < 1e-3, `${duration} s of ${times.length} frames`);
    assert.ok(Math.abs(currentTime - duration) < 1e-3);
    const said = await page.evaluate(() => window.durations_);
    assert.equal(said.at(-1), duration);
    assert.ok(said.length > 2);
  },

  async 'what cannot be shown says why'(page) {
    await page.evaluate(() => (document.querySelector('relievo-player').src = 'http://127.0.0.1:9/'));
    await when(page, (p) => p.state === 'failed' && /names no stream/.test(p.message));
    assert.match(await page.textContent('relievo-player .message'), /names no stream/);
    await page.evaluate(() => (document.querySelector('relievo-player').src = 'take.mcap'));
    await when(page, (p) => p.state === 'file');
  },

  async 'taken out of the page it rests, put back it goes on'(page) {
    const workers = page.workers().length;
    await page.evaluate(() => {
      window.element_ = document.querySelector('relievo-player');
      window.element_.remove();
    });
    await page.waitForFunction(() => document.querySelector('relievo-player') === null);
    await eventually('its workers go on', () => page.workers().length === workers - kWorkers);
    await page.evaluate(() => {
      window.frames_.length = 0;
      document.body.append(window.element_);
    });
    await page.waitForFunction(() => window.frames_.length > 2);
    assert.ok((await shot(page)).opaque > 0.15);
  },

  async 'the example shows what its address asks for'() {
    const page = await newPage(`/relievo-player/example/index.html?src=${encodeURIComponent('/take.mcap')}`);
    await page.waitForFunction(() => /file: frame \d+, \d+ vertices/.test(document.querySelector('output').value));
    await page.close();
  },

  async 'no error, nothing against the policy'() {
    assert.deepEqual(complaints, []);
  },
};

async function newPage(path) {
  const page = await browser.newPage({ viewport: { width: 720, height: 560 } });
  page.setDefaultTimeout(kPatienceMs);
  page.on('pageerror', (error) => complaints.push(`page error: ${error.message}`));
  page.on('console', (message) => {
    if (message.type() === 'error') complaints.push(`console: ${message.text()}`);
  });
  await page.goto(origin + path);
  return page;
}

let failed = 0;
try {
  const page = await newPage('/page.html');
  for (const [name, check] of Object.entries(checks)) {
    try {
      await check(page);
      console.log(`ok    ${name}`);
    } catch (error) {
      ++failed;
      console.log(`FAIL  ${name}: ${error.stack}`, error.stdout?.toString() ?? '');
      console.log('      ', JSON.stringify(await player(page, (p) => p && [p.state, p.message, p.duration, p.currentTime]).catch(() => null)));
    }
  }
} finally {
  await browser.close();
  await rig.kill();
  await keeper.kill();
  web.close();
  rmSync(scratch, { recursive: true, force: true });
}
console.log(failed === 0 ? 'all checks passed' : `${failed} checks failed`);
process.exit(failed === 0 ? 0 : 1);
