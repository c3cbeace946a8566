// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium: a range of the time line is taken away whole or not at all. As MCAP it is what was
// recorded, byte for byte, with the key frame that it needs, of a file of this device, of the server's, and of what is
// kept of a live stream; as PLY and GLB it has the surfaces that `relievo export` writes. Cancelled, nothing is saved.
// Run as: in_own_domain node range_test.mjs RELIEVO_SERVER RELIEVO [h264], in web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readdirSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { basename, join } from 'node:path';
import { eventually, launchChromium } from './chromium.mjs';
import { inState, look, pagesOf, runChecks, shownPast } from './feeder.mjs';
import { recordObject } from './recorded.mjs';
import { Server } from './server.mjs';
import { seek } from './timeline.mjs';
import { startWeb } from './web.mjs';

const [serverPath, relievoPath, h264] = process.argv.slice(2);
const kKeyEvery = 6;
const kFrames = 25;
const scratch = mkdtempSync(join(tmpdir(), 'relievo-range-'));
const kSource = 'sim:object,width=320,height=240,stripes=60,rate=10';

const record = (name, options) =>
  recordObject(serverPath, join(scratch, `${name}.mcap`), {
    rate: 10,
    frames: kFrames,
    options: ['--key-interval', String(kKeyEvery), ...options],
  });
const recorded = record('object', []);
const info = (file) => JSON.parse(execFileSync(relievoPath, ['info', '--json', file], { encoding: 'utf8' }));
/** Surfaces of a recording, by the number of the camera's frame, as the client writes them. */
function surfacesOf(file, format) {
  const folder = mkdtempSync(join(scratch, `${format}-`));
  execFileSync(relievoPath, ['export', file, '--out', folder, '--format', format], { stdio: 'ignore' });
  const files = readdirSync(folder).filter((name) => name.endsWith(`.${format}`));
  return new Map(files.map((name) => [Number(/(\d+)\.\w+$/.exec(name)[1]), readFileSync(join(folder, name))]));
}
/** Files of a ZIP file, by what else reads such. */
function unzip(file) {
  const folder = mkdtempSync(join(scratch, 'zip-'));
  execFileSync('python3', ['-c', 'import sys, zipfile\nz = zipfile.ZipFile(sys.argv[1])\nassert z.testzip() is None\nz.extractall(sys.argv[2])', file, folder]);
  return new Map(readdirSync(folder).map((name) => [name, readFileSync(join(folder, name))]));
}

const server = await Server.start(serverPath, ['--source', kSource, '--stream', 'live', '--key-interval', String(kKeyEvery)]);
const browser = await launchChromium();
const complaints = [];
const { open } = pagesOf(browser, server.address, complaints);
const playback = (page) => page.evaluate(() => window.relievo.diagnostics().playback);

/** From the frame at one index to that at the other, at the time line. */
async function setRange(page, first, last) {
  await page.focus('#view');
  await page.waitForFunction(() => window.relievo.diagnostics().playback?.playing === false);
  for (const [index, key] of [[first, '['], [last, ']']]) {
    await seek(page, index);
    await eventually(`not at frame ${index}`, async () => (await playback(page)).index === index);
    await page.keyboard.press(key);
  }
}
async function openPanel(page) {
  if (!(await page.isVisible('#panel-take'))) await page.click('#tool-take');
  await page.waitForSelector('#range');
}
async function take(page, name) {
  await openPanel(page);
  const [file] = await Promise.all([page.waitForEvent('download'), page.click(`#range button:text-is("${name}")`)]);
  const path = join(scratch, `${Math.random()}-${file.suggestedFilename()}`);
  await file.saveAs(path);
  return { path, name: file.suggestedFilename() };
}
const says = (page, words) => page.waitForFunction((of) => new RegExp(of).test(document.querySelector('#panel-take [role=status]')?.textContent), words.source);
async function openRecorded(page, file) {
  await page.setInputFiles('#file', file);
  await page.waitForFunction((name) => window.relievo.diagnostics().file === name, basename(file)); // no longer another
  await page.waitForFunction(() => window.relievo.diagnostics().playback.keys.every((k) => k !== null));
  const { keys } = await playback(page);
  assert.equal(keys.length, kFrames);
  return keys.indexOf(true, 1); // the second key frame
}
/** What is the same in a part as in the whole: surfaces, bit by bit. */
function assertPart(part, whole, numbers) {
  const surfaces = surfacesOf(part, 'ply');
  assert.deepEqual([...surfaces.keys()].sort((a, b) => a - b), numbers);
  for (const [number, bytes] of surfaces) assert.ok(bytes.equals(whole.get(number)), `another surface in frame ${number}`);
}

const whole = surfacesOf(recorded, 'ply');
const numbers = [...whole.keys()].sort((a, b) => a - b);
let key; // an index that is one's

const checks = {
  async 'a recording of this device: MCAP, from a frame that builds on a key frame'(page) {
    key = await openRecorded(page, recorded);
    await setRange(page, key + 2, key + 7);
    await openPanel(page);
    await page.waitForFunction(() => /: 6 frames/.test(document.querySelector('#range')?.textContent));
    const { path, name } = await take(page, 'MCAP');
    assert.equal(name, 'relievo-object.mcap');
    const told = info(path);
    assert.equal(told.damaged_parts + told.unreadable, 0);
    assert.deepEqual(told.info, info(recorded).info);
    assertPart(path, whole, [key, key + 2, key + 3, key + 4, key + 5, key + 6, key + 7].map((i) => numbers[i]));
    await says(page, /^relievo-object\.mcap: 7 frames, [\d.]+ MB$/);
  },

  async 'as PLY and GLB, a file a frame'(page) {
    for (const [button, format] of [['PLYs', 'ply'], ['GLBs', 'glb']]) {
      const { path, name } = await take(page, button);
      assert.equal(name, `relievo-object.${format}.zip`);
      const files = unzip(path);
      const wanted = numbers.slice(key + 2, key + 8);
      assert.deepEqual([...files.keys()].sort(), wanted.map((n) => `${String(n).padStart(6, '0')}.${format}`));
      const clients = surfacesOf(recorded, format);
      for (const number of wanted) {
        const mine = files.get(`${String(number).padStart(6, '0')}.${format}`);
        const other = clients.get(number);
        const count = (bytes) =>
          format === 'ply'
            ? bytes.toString('latin1', 0, 600).match(/element (vertex|face) \d+/g).join()
            : JSON.parse(bytes.toString('utf8', 20, 20 + bytes.readUInt32LE(12))).accessors.find((a) => a.type === 'VEC3').count;
        assert.deepEqual(count(mine), count(other), `frame ${number}`);
        if (format === 'glb') assert.ok(mine.includes(Buffer.from([0xff, 0xd8, 0xff])), 'without its picture');
      }
    }
  },

  async 'cancelled on its way, nothing is saved, and it can be begun again'(page) {
    let downloads = 0;
    page.on('download', () => ++downloads);
    await page.focus('#view');
    await page.keyboard.press('\\');
    await page.evaluate(
      () =>
        new Promise((resolve) => {
          const timer = setInterval(() => {
            if (document.querySelector('#range progress').value < 2) return;
            clearInterval(timer);
            [...document.querySelectorAll('#range button')].find((b) => b.textContent === 'Cancel').click();
            resolve();
          }, 1);
          [...document.querySelectorAll('#range button')].find((b) => b.textContent === 'GLBs').click();
        }),
    );
    await says(page, /^Cancelled/);
    await page.waitForTimeout(500);
    assert.equal(downloads, 0, 'a file all the same');
    const { path } = await take(page, 'MCAP');
    assertPart(path, whole, numbers);
  },

  async 'a recording of the server'() {
    const { address, stop } = await startWeb(relievoPath, recorded);
    try {
      const { open: openThere } = pagesOf(browser, address.replace(/\/$/, ''), complaints);
      const page = await openThere('/?stream=object');
      await inState(page, 'file');
      await setRange(page, 3, 8);
      const { path } = await take(page, 'MCAP');
      assertPart(path, whole, numbers.slice(key > 3 ? 0 : key, 9).filter((n) => n === numbers[0] || n >= numbers[3]));
      await page.close();
    } finally {
      await stop();
    }
  },

  async 'what is kept of a live stream, while more comes'() {
    const page = await open('/?stream=live');
    await inState(page, 'live');
    await page.waitForFunction(() => window.relievo.diagnostics().playback.times.length > 14);
    await page.focus('#view');
    await page.keyboard.press(' ');
    await inState(page, 'shifted');
    // Of the newest, as the oldest go one by one meanwhile where the machine is slow.
    const { first, keys } = await playback(page);
    const begin = first + keys.length - 8;
    await setRange(page, begin, begin + 6);
    const { path, name } = await take(page, 'MCAP');
    assert.equal(name, 'relievo-live.mcap');
    const told = info(path);
    assert.equal(told.stream, 'live');
    assert.equal(told.damaged_parts + told.unreadable, 0);
    assert.equal(told.info.pattern.stripes, 60);
    assert.equal(told.frames, 7 + (keys[begin - first] ? 0 : 1));
    assert.equal(surfacesOf(path, 'ply').size, told.frames);
    await page.close();
  },

  ...(h264 === 'h264' && {
    async 'with video: from the key frame on'(page) {
      const video = record('video', ['--texture', 'h264']);
      const at = await openRecorded(page, video);
      await setRange(page, at + 3, at + 5);
      const { path } = await take(page, 'MCAP');
      const all = [...surfacesOf(video, 'ply').keys()].sort((a, b) => a - b);
      assertPart(path, surfacesOf(video, 'ply'), [0, 1, 2, 3, 4, 5].map((i) => all[at + i]));
      const { path: zipped } = await take(page, 'GLBs');
      const files = unzip(zipped);
      assert.equal(files.size, 3);
      for (const bytes of files.values()) assert.ok(bytes.includes(Buffer.from([0xff, 0xd8, 0xff])), 'without its picture');
      assert.equal((await look(page)).errors, 0);
    },
  }),

  async 'a surface alone has no range'(page) {
    await page.setInputFiles('#file', { name: 'one.ply', mimeType: 'application/octet-stream', buffer: whole.get(numbers[0]) });
    await page.waitForFunction(() => window.relievo.diagnostics().file === 'one.ply');
    await page.waitForSelector('#range', { state: 'hidden' });
  },

  async 'no error, no request to another host'() {
    assert.deepEqual(complaints, []);
  },
};

let failed = 1;
try {
  const page = await open();
  await shownPast(page, 1);
  failed = await runChecks(checks, page);
} finally {
  await browser.close();
  await server.kill();
  rmSync(scratch, { recursive: true, force: true });
}
process.exit(failed === 0 ? 0 : 1);
