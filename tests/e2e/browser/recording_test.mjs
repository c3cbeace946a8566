// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium: a recording of this device plays, is scrubbed and stepped through to the right frames
// with the right surfaces, also where frames build on others; surfaces that were exported are shown where they are.
// Run as: in_own_domain node recording_test.mjs GATEWAY_FEEDER RELIEVO_SERVER RELIEVO, in web/viewer. Exit 77: no Chromium.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { copyFileSync, mkdtempSync, readdirSync, readFileSync, rmSync, statSync, truncateSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { eventually, kPatienceMs, launchChromium } from './chromium.mjs';
import { Feeder, inState, look, pagesOf, runChecks, shownPast, still } from './feeder.mjs';
import { recordObject } from './recorded.mjs';
import { marksAt, pointAt, seek } from './timeline.mjs';
import { startWeb } from './web.mjs';

const [feederPath, serverPath, relievoPath] = process.argv.slice(2);
const kFrames = 25;
const kKeyEvery = 6;

const scratch = mkdtempSync(join(tmpdir(), 'relievo-recording-'));
// At 6 frames a second, so that it takes several chunks of half a second, of which some are left where it is cut short.
const recorded = recordObject(serverPath, join(scratch, 'object.mcap'), { rate: 6, frames: kFrames, options: ['--key-interval', String(kKeyEvery)] });
execFileSync(relievoPath, ['export', recorded, '--out', join(scratch, 'ply'), '--format', 'ply'], { stdio: 'ignore' });
execFileSync(relievoPath, ['export', recorded, '--out', join(scratch, 'glb'), '--format', 'glb'], { stdio: 'ignore' });
const exported = (format, index) => join(scratch, format, readdirSync(join(scratch, format)).filter((f) => f.endsWith(format)).sort()[index]);

const feeder = await Feeder.start(feederPath);
const browser = await launchChromium();
const complaints = [];
const { newPage, open } = pagesOf(browser, `http://127.0.0.1:${feeder.port}`, complaints);

const playback = (page) => page.evaluate(() => window.relievo.diagnostics().playback);
/** Which camera frame is shown, and what its surface is: exact, as numbers are decoded alike whatever came before. */
const shownSurface = (page) => page.evaluate(() => window.relievo.surface());
// A page decodes its first frames in TypeScript, until the WebAssembly is there, which rounds elsewhere.
const assertSame = (now, { depth }, what) => assert.ok(Math.abs(now.depth - depth) < 1e-6 * depth, `${what}: ${now.depth}, not ${depth}`);
const onFrame = (page, number) => page.waitForFunction((n) => window.relievo.diagnostics().frame === n, number);

/** Gathers what a page sends from here on: requests with a body, and more over a socket than words. */
async function sentBy(page) {
  const sent = [];
  const client = await page.context().newCDPSession(page);
  client.on('Network.requestWillBeSent', ({ request }) => {
    if (request.method !== 'GET' || request.hasPostData) sent.push(`${request.method} ${request.url}`);
  });
  client.on('Network.webSocketFrameSent', ({ response }) => {
    if (response.payloadData.length > 1000) sent.push(`${response.payloadData.length} over a socket`);
  });
  await client.send('Network.enable');
  return sent;
}
let sent; // while files of this device are opened

const surfaces = new Map(); // by camera frame, as they came one after the other
let numbers = []; // of the camera frames, in order

const checks = {
  async 'a recording is opened by the picker, and plays to its end'(page) {
    await inState(page, 'empty');
    sent = await sentBy(page);
    const [chooser] = await Promise.all([page.waitForEvent('filechooser'), page.click('#tool-open')]);
    await chooser.setFiles(recorded);
    await shownPast(page, 1);
    await inState(page, 'file');
    await page.waitForFunction(() => !window.relievo.diagnostics().playback.playing);
    const { times } = await playback(page);
    assert.equal(times.length, kFrames);
    await eventually('the last frame is not shown', async () => (await playback(page)).index === times.length - 1);
    assert.equal((await look(page)).errors, 0);
  },

  async 'it is stepped through frame by frame'(page) {
    const { times } = await playback(page);
    const last = (await shownSurface(page)).number;
    await page.keyboard.press('Home');
    for (let i = 0; i < times.length; ++i) {
      if (i > 0) await page.keyboard.press('.');
      await eventually(`frame ${i} is not shown`, async () => {
        const now = await shownSurface(page);
        const isNext = i === 0 ? now.number < last : now.number > numbers[i - 1]; // decoding takes its time
        if ((await playback(page)).index !== i || !isNext) return false;
        surfaces.set(now.number, now);
        numbers.push(now.number);
        return true;
      });
    }
    assert.deepEqual(numbers, [...numbers].sort((a, b) => a - b));
    assert.ok(new Set([...surfaces.values()].map((s) => s.depth.toFixed(6))).size > times.length / 2, 'the surfaces are all alike');
    assert.equal((await look(page)).errors, 0, (await look(page)).lastError);
  },

  async 'key frames are marked, and no frame is missing'(page) {
    await page.waitForFunction(() => window.relievo.diagnostics().playback.keys.every((k) => k !== null));
    const { keys, gaps } = await playback(page);
    const at = keys.flatMap((k, i) => (k ? [i] : []));
    assert.ok(at.length > 1 && at.length < keys.length, `key frames at ${at}`);
    assert.ok(at.slice(1).every((k, i) => k - at[i] === kKeyEvery), `key frames at ${at}`);
    assert.ok(gaps.every((gap) => gap === 0), `gaps ${gaps}`);
    await eventually('the marks are not drawn where key frames are', async () => {
      const marks = await marksAt(page, '--quiet');
      // Where the machine that recorded was busy, one may have come so soon before or after a key frame that their places are one.
      const isAlone = (i) => marks.every(({ x }, other) => !keys[other] || Math.abs(x - marks[i].x) > 4);
      return marks.every(({ high, ofColour }, i) => (keys[i] ? high >= 3 && high < 9 && ofColour : high === 0 || !isAlone(i)));
    });
  },

  async 'wherever it is scrubbed to, the surface is that of this frame'(page) {
    const { keys } = await playback(page);
    for (const index of [3, 17, 1, keys.length - 1, 8, 7, 0]) {
      await seek(page, index);
      await onFrame(page, numbers[index]);
      assertSame(await shownSurface(page), surfaces.get(numbers[index]), `frame ${index}, key: ${keys[index]}`);
    }
    await page.keyboard.press(',');
    await still(page);
    assert.equal((await playback(page)).index, 0);
    assert.equal((await look(page)).errors, 0);
  },

  async 'under the cursor of the time line is the picture of the frame there'(page) {
    await seek(page, 2);
    await onFrame(page, numbers[2]);
    const { times } = await playback(page);
    const pictures = new Map();
    for (const index of [15, 6, times.length - 1, 15]) {
      const seen = await pointAt(page, index);
      assert.equal(seen.frame, numbers[index], 'another frame is under the cursor');
      assert.ok(seen.deviation > 10, `its picture is flat: ${seen.deviation}`);
      assert.ok(seen.width >= 100 && Math.abs(seen.width / seen.height - 4 / 3) < 0.05, `${seen.width}x${seen.height}`);
      assert.match(seen.time, /^\d+:\d\d\.\d{3} \//);
      pictures.set(index, seen.hash);
    }
    assert.equal(new Set(pictures.values()).size, 3, 'the pictures are all alike');
    assert.equal((await playback(page)).index, 2, 'looking is no seeking');
    await page.mouse.move(300, 200);
    await page.waitForSelector('.preview', { state: 'hidden' });
  },

  async 'a range is repeated, at another speed'(page) {
    const { times } = await playback(page);
    await seek(page, 4);
    await onFrame(page, numbers[4]);
    await page.keyboard.press('[');
    await seek(page, 9);
    await onFrame(page, numbers[9]);
    await page.keyboard.press(']');
    await page.selectOption('#timeline select[title^="Speed"]', '4');
    await page.evaluate(() => document.querySelector('#view').focus());
    await page.keyboard.press(' ');
    const { shown } = await look(page);
    await shownPast(page, shown + 12); // more than the range has
    const now = await playback(page);
    assert.equal(now.speed, 4);
    assert.ok(now.playing);
    assert.ok(Math.abs(now.loop.from - times[4]) < 1 && Math.abs(now.loop.to - times[9]) < 1, JSON.stringify(now.loop));
    assert.ok(now.position >= now.loop.from - 1 && now.position <= now.loop.to + 1, `at ${now.position}`);
    await page.keyboard.press(' ');
    await page.keyboard.press('\\');
    assert.equal((await playback(page)).loop, null);
  },

  async "the rig's camera of a recording is known"(page) {
    await page.keyboard.press('c');
    await page.waitForFunction(() => window.relievo.diagnostics().way === 'camera');
    assert.equal(await page.isDisabled('#ways button:nth-child(3)'), false);
    await page.keyboard.press('o');
  },

  async 'of files dropped on the page the first that can be is opened, and it is said: an exported PLY'(page) {
    const index = 5;
    await seek(page, index);
    await still(page); // of the range that was repeated a frame may still be on its way
    await onFrame(page, numbers[index]);
    const before = await page.evaluate(() => window.relievo.extent());
    const bytes = readFileSync(exported('ply', index)).toString('base64');
    await page.evaluate((data) => {
      const content = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
      const transfer = new DataTransfer();
      for (const name of ['notes.txt', 'surface.ply', 'another.ply']) transfer.items.add(new File([content], name));
      for (const type of ['dragover', 'drop']) {
        document.body.dispatchEvent(new DragEvent(type, { dataTransfer: transfer, bubbles: true, cancelable: true }));
      }
    }, bytes);
    await page.waitForFunction(() => window.relievo.diagnostics().file === 'surface.ply');
    assert.match(await page.textContent('#source'), /^surface\.ply: one of 3 files/);
    await still(page);
    assert.equal(await page.isVisible('#timeline'), false);
    const after = await page.evaluate(() => window.relievo.extent());
    for (const end of ['min', 'max']) {
      for (const i of [0, 1, 2]) assert.ok(Math.abs(after[end][i] - before[end][i]) < 2e-3, `${end} ${after[end]}, not ${before[end]}`);
    }
    const { pixels } = await look(page);
    assert.ok(pixels.covered > 0.1 && pixels.deviation > 5, JSON.stringify(pixels));
  },

  async 'a GLB stands where it stood, with its picture'(page) {
    const before = await page.evaluate(() => window.relievo.extent());
    await page.setInputFiles('#file', exported('glb', 5));
    await page.waitForFunction(() => /glb$/.test(window.relievo.diagnostics().file));
    await still(page);
    const after = await page.evaluate(() => window.relievo.extent());
    for (const end of ['min', 'max']) {
      for (const i of [0, 1, 2]) assert.ok(Math.abs(after[end][i] - before[end][i]) < 2e-3, `${end} ${after[end]}, not ${before[end]}`);
    }
    await page.keyboard.press('v');
    await page.waitForFunction(() => document.querySelector('#picture').width === 320);
    for (const beside of ['stripes', 'both', 'none']) {
      await page.keyboard.press('v');
      assert.equal(await page.evaluate(() => document.body.dataset.split), beside);
    }
  },

  async 'a recording that was cut short shows what is left, and says so'(page) {
    const cut = join(scratch, 'cut.mcap');
    copyFileSync(recorded, cut);
    truncateSync(cut, Math.floor(statSync(cut).size * 0.7));
    await page.setInputFiles('#file', cut);
    await page.waitForFunction(() => window.relievo.diagnostics().playback?.times.length > 3);
    assert.ok((await playback(page)).times.length < numbers.length);
    const wide = page.viewportSize();
    for (const size of [wide, { width: 390, height: 844 }]) {
      await page.setViewportSize(size);
      await page.waitForSelector('#source', { state: 'visible' });
      assert.match(await page.textContent('#source'), /cut\.mcap.*cut short/);
      assert.equal(await page.getAttribute('#source', 'title'), await page.textContent('#source'));
      assert.equal(await page.evaluate(() => document.querySelector('#streams').selectedOptions[0].text), 'Choose…');
    }
    const isWhole = () => page.evaluate(() => document.querySelector('#source').scrollWidth <= document.querySelector('#source').clientWidth);
    assert.ok(await isWhole(), 'what is said of it is cut off on a phone');
    await page.setViewportSize(wide);
  },

  async 'what is none, or damaged, is refused with a reason, and the rest goes on'(page) {
    const png = Buffer.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0, 0, 0, 13]);
    const promising = 'ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nend_header\n';
    for (const [name, content, words] of [
      ['words.mcap', 'not a recording at all, only some words in a file', /no MCAP file/],
      ['picture.mcap', png, /no MCAP file.*choose a recording/],
      ['empty.ply', '', /is empty: copy it/],
      ['promising.ply', promising, /ends before all that it announces/],
      ['cut.glb', readFileSync(exported('glb', 5)).subarray(0, 5000), /ends before all that it announces/],
    ]) {
      await page.setInputFiles('#file', { name, mimeType: 'application/octet-stream', buffer: Buffer.from(content) });
      await page.waitForFunction((title) => document.querySelector('#card-title')?.textContent.includes(title), name);
      assert.match(await page.textContent('#card-text'), words, name);
      await page.click('#dismiss');
      await page.waitForFunction(() => document.querySelector('#card').hidden);
      assert.equal((await look(page)).state, 'file');
    }
  },

  async 'what is said of them is put away though it moves while it is clicked'(page) {
    await page.setInputFiles('#file', { name: 'none.mcap', mimeType: 'application/octet-stream', buffer: Buffer.from('none') });
    await page.waitForFunction(() => document.querySelector('#card-title')?.textContent.includes('none.mcap'));
    await page.hover('#dismiss'); // once it does not move any more
    const { y, height } = await page.locator('#dismiss').boundingBox();
    await page.mouse.down();
    await page.evaluate(() => (document.querySelector('#card').style.marginBottom = '90px')); // as a line more below does
    assert.ok((await page.locator('#dismiss').boundingBox()).y + height < y);
    await page.mouse.up();
    await page.waitForFunction(() => document.querySelector('#card').hidden);
    await page.evaluate(() => document.querySelector('#card').removeAttribute('style'));
  },

  async 'of two files the one that was chosen last is shown, though the other takes longer to open'(page) {
    await page.evaluate(() => {
      const { arrayBuffer } = Blob.prototype;
      const released = new Promise((resolve) => (window.releaseFiles = resolve));
      Blob.prototype.arrayBuffer = async function () {
        await released;
        const bytes = await arrayBuffer.call(this);
        window.wasReleased = true;
        return bytes;
      };
      window.restoreFiles = () => (Blob.prototype.arrayBuffer = arrayBuffer);
    });
    await page.setInputFiles('#file', exported('ply', 5));
    await page.setInputFiles('#file', { name: 'late.mcap', mimeType: 'application/octet-stream', buffer: Buffer.alloc(0) });
    await page.waitForFunction(() => document.querySelector('#card-title')?.textContent.includes('late.mcap'));
    const { file } = await look(page);
    await page.evaluate(() => window.releaseFiles());
    await page.waitForFunction(() => window.wasReleased);
    await page.waitForTimeout(1000); // for what should not happen
    assert.equal((await look(page)).file, file);
    assert.ok(await page.isVisible('#card'));
    await page.evaluate(() => window.restoreFiles());
    await page.click('#dismiss');
  },

  async 'nothing of them has left the device'() {
    assert.deepEqual(sent, []);
    const probe = await newPage(); // it would have been seen
    await probe.goto(`http://127.0.0.1:${feeder.port}/`);
    const seen = await sentBy(probe);
    await probe.evaluate(() => fetch('api/streams', { method: 'POST', body: 'of a file' }).catch(() => null));
    await eventually(() => `not seen, but ${seen}`, () => /^POST .*api.streams$/.test(seen.join()));
    await probe.close();
  },

  async 'a stream is chosen again'(page) {
    feeder.say('start ball');
    await page.waitForFunction(() => document.querySelectorAll('#streams option:enabled').length === 1);
    await page.setInputFiles('#file', { name: 'none.mcap', mimeType: 'application/octet-stream', buffer: Buffer.from('none') });
    await page.waitForFunction(() => /none\.mcap/.test(document.querySelector('#card-title').textContent));
    await page.selectOption('#streams', 'ball');
    await inState(page, 'live');
    await page.waitForFunction(() => window.relievo.diagnostics().playback.following === true); // no longer the file's
    await page.waitForFunction(() => document.querySelector('#card').hidden); // nor what was said of another
    await page.close(); // what follows has pages of its own
  },

  async 'a stream that is chosen while a recording opens stays chosen, also when it goes'() {
    feeder.say('also other');
    const page = await newPage();
    let release;
    const released = new Promise((resolve) => (release = resolve));
    await page.route('**/recordings/*', async (route) => {
      await released;
      await route.fulfill({ body: 'no recording' });
    });
    await page.goto(`http://127.0.0.1:${feeder.port}/?recording=slow.mcap`);
    await page.waitForFunction(() => document.querySelectorAll('#streams option:enabled').length === 2);
    await page.selectOption('#streams', 'ball');
    await inState(page, 'live');
    const answered = page.waitForResponse('**/recordings/*');
    release();
    await answered;
    feeder.say('gone');
    await page.waitForFunction(() => /left the network/.test(document.querySelector('#card-text')?.textContent));
    await page.waitForTimeout(3000); // for what should not happen: the list comes each second or two
    assert.equal((await look(page)).stream, 'ball');
    await page.close();
    feeder.say('start ball');
  },

  async 'a recording of the server plays for each page by itself, once the person has a token'() {
    const tokens = join(scratch, 'tokens');
    writeFileSync(tokens, 'a-token-for-this-test\n', { mode: 0o600 });
    const { address, stop } = await startWeb(relievoPath, recorded, ['--token-file', tokens]);
    try {
      const context = await browser.newContext({ viewport: { width: 800, height: 500 } });
      const pages = [await context.newPage(), await context.newPage()];
      for (const page of pages) page.setDefaultTimeout(kPatienceMs);
      await pages[0].goto(address);
      await pages[0].fill('input[name=token]', 'a-token-for-this-test');
      await pages[0].click('button');
      await inState(pages[0], 'file');
      assert.equal(pages[0].url(), address, 'the token is still in the address');
      await pages[1].goto(`${address}?stream=object`);
      for (const [i, index] of [3, 17].entries()) {
        await inState(pages[i], 'file');
        await pages[i].waitForFunction(() => window.relievo.diagnostics().playback?.playing === false);
        await seek(pages[i], index);
      }
      for (const [i, index] of [3, 17].entries()) {
        await onFrame(pages[i], numbers[index]);
        assertSame(await shownSurface(pages[i]), surfaces.get(numbers[index]), `frame ${index}`);
        assert.equal((await playback(pages[i])).times.length, numbers.length);
        assert.equal((await look(pages[i])).errors, 0);
        assert.ok(await pages[i].isVisible('#timeline'));
      }
      const seen = await pointAt(pages[0], 11);
      assert.equal(seen.frame, numbers[11]);
      assert.equal((await playback(pages[0])).index, 3);
      await pages[1].waitForFunction(() => window.relievo.diagnostics().playback.keys.every((k) => k !== null));
      const { keys } = await playback(pages[1]);
      const marked = keys.flatMap((k, at) => (k ? [at] : []));
      assert.ok(marked.length > 1 && marked.slice(1).every((k, at) => k - marked[at] === kKeyEvery), `key frames at ${marked}`);
      await context.close();
    } finally {
      await stop();
    }
  },

  async 'what of a recording does not come is told, waited for, and gone on with'() {
    // Above 16 MB, so that most of it is read where it is needed.
    const options = ['--texture', 'png'];
    const large = recordObject(serverPath, join(scratch, 'large.mcap'), { rate: 6, frames: 36, size: 'width=640,height=480,stripes=60', options });
    assert.ok(statSync(large).size > 17e6, `${statSync(large).size} bytes`);
    const { address, stop } = await startWeb(relievoPath, large);
    try {
      const page = await newPage();
      let status = 200;
      await page.route('**/recordings/*', (route) => (status === 200 ? route.continue() : route.fulfill({ status, body: 'no' })));
      await page.goto(address);
      await shownPast(page, 3);
      status = 503;
      await seek(page, 30);
      await inState(page, 'stalled');
      await page.waitForFunction(() => /HTTP 503.*goes on by itself/.test(document.querySelector('#card-text').textContent));
      const { position, playing } = await playback(page);
      await page.waitForTimeout(1000);
      assert.deepEqual([(await playback(page)).position, playing], [position, true]);
      status = 200;
      await inState(page, 'file');
      await page.waitForFunction(() => window.relievo.diagnostics().playback.index >= 30);
      assert.equal((await look(page)).errors, 0);
      await page.keyboard.press('Space');
      status = 404;
      await seek(page, 20);
      await inState(page, 'stalled');
      assert.match(await page.textContent('#card-text'), /It is not there \(HTTP 404\)\.$/);
      status = 200;
      await page.keyboard.press('.');
      await inState(page, 'file');
      await page.close();
    } finally {
      await stop();
    }
  },

  async 'a link to a recording of the server restores time, view and whether it plays'() {
    const { address, stop } = await startWeb(relievoPath, recorded);
    const { open: openThere } = pagesOf(browser, address.replace(/\/$/, ''), complaints);
    const follow = (link) => openThere(link.slice(address.length - 1));
    try {
      const page = await openThere('/?stream=object');
      await inState(page, 'file');
      await page.waitForFunction(() => window.relievo.diagnostics().playback?.playing === false);
      await seek(page, 13);
      await onFrame(page, numbers[13]);
      await page.keyboard.press('ArrowLeft');
      await still(page);
      const pose = await page.evaluate(() => window.relievo.pose());
      const link = await page.evaluate(() => window.relievo.link());
      assert.match(link, /\?stream=object#.*&time=\d+\.\d{3}&play=0$/);
      await page.close();

      const other = await follow(link);
      await inState(other, 'file');
      await onFrame(other, numbers[13]);
      await still(other);
      const now = await playback(other);
      assert.equal(now.index, 13);
      assert.equal(now.playing, false);
      assertSame(await shownSurface(other), surfaces.get(numbers[13]), 'frame 13');
      const { position } = await other.evaluate(() => window.relievo.pose());
      for (const i of [0, 1, 2]) assert.ok(Math.abs(position[i] - pose.position[i]) < 1e-3, `${position}, not ${pose.position}`);
      await other.close();

      const playing = await follow(link.replace('play=0', 'play=1'));
      await playing.waitForFunction((n) => window.relievo.diagnostics().frame > n, numbers[13]);
      await eventually('it does not play to its end', async () => (await playback(playing)).index === numbers.length - 1);
      assert.equal((await look(playing)).errors, 0);
      await playing.close();
    } finally {
      await stop();
    }
  },

  async 'no error, no request to another host'() {
    assert.deepEqual(complaints, []);
  },
};

let failed = 1;
try {
  failed = await runChecks(checks, await open());
} finally {
  await browser.close();
  await feeder.kill();
  rmSync(scratch, { recursive: true, force: true });
}
process.exit(failed === 0 ? 0 : 1);
