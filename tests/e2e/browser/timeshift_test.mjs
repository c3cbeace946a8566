// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium: a live stream is stopped, gone back in and stepped through to the right surfaces, plays
// on behind live, and returns to live without a fault; also where frames build on others, and after the server is gone.
// Run as: in_own_domain node timeshift_test.mjs GATEWAY_FEEDER RELIEVO_SERVER [h264], in web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { eventually, launchChromium } from './chromium.mjs';
import { depthOf, Feeder, inState, look, pagesOf, runChecks, shownPast } from './feeder.mjs';
import { Server } from './server.mjs';
import { marksAt, pointAt, seek as pull } from './timeline.mjs';

const [feederPath, serverPath, video] = process.argv.slice(2);
const kScene = ['--source', 'sim:object,width=320,height=240,stripes=60,rate=6'];
const feeder = await Feeder.start(feederPath);
const browser = await launchChromium();
const complaints = [];
const { open } = pagesOf(browser, `http://127.0.0.1:${feeder.port}`, complaints);

const playback = (page) => page.evaluate(() => window.relievo.diagnostics().playback);
/** The index behind the last that is kept. */
const end = (page) =>
  page.evaluate(() => {
    const { first, times } = window.relievo.diagnostics().playback;
    return first + times.length;
  });
const surface = (page) => page.evaluate(() => window.relievo.surface());
const kept = (page, frames) =>
  page.waitForFunction((least) => window.relievo.diagnostics().playback?.times.length >= least, frames);
/** Until so many frames are kept that were not yet; after a minute the oldest go. */
async function keptMore(page, frames) {
  const least = (await end(page)) + frames;
  await eventually('no more is kept', async () => (await end(page)) >= least);
}
/** Until all that was handed to the decoder is on the screen. */
const settled = (page) =>
  page.waitForFunction(() => {
    const { received, shown, errors, drops } = window.relievo.diagnostics();
    return shown + errors + drops.viewer === received;
  });
/** To a frame of those kept, by the time line; resolves when it is shown. */
async function seek(page, index) {
  await pull(page, index);
  await eventually(`frame ${index} is not sent`, async () => (await playback(page)).index === index);
  await settled(page);
}
const press = async (page, key) => {
  await page.keyboard.press(key);
  await settled(page);
};
const errors = async (page) => {
  const now = await look(page);
  assert.equal(now.errors, 0, now.lastError);
};
const surfaceHash = async (page) => (await surface(page)).hash;
/** Goes to each of these frames one after the other, then in another order, and compares what `read` tells of them. */
async function compare(page, indices, read = surfaceHash) {
  await seek(page, indices[0]);
  await page.keyboard.press('['); // to be repeated: they stay, however long this takes
  const hashes = new Map();
  for (const index of indices) {
    await seek(page, index);
    hashes.set(index, await read(page));
  }
  for (const index of [...indices].sort((a, b) => ((a * 7) % 11) - ((b * 7) % 11))) {
    await seek(page, index);
    assert.equal(await read(page), hashes.get(index), `frame ${index}`);
  }
  assert.ok(new Set(hashes.values()).size > indices.length / 2, 'they are all alike');
}

// A page that is late loses frames, and what follows a loss is a key frame: there are some of both in the end.
const keysAmongOthers = (page) =>
  page.waitForFunction(() => {
    const { keys } = window.relievo.diagnostics().playback;
    return keys.filter((k) => k).length > 2 && keys.includes(false);
  });

const onFeeder = {
  async 'a live stream has a time line'(page) {
    await inState(page, 'live');
    await kept(page, 12);
    await page.waitForSelector('#timeline #follow[aria-pressed=true]', { state: 'visible' });
    const now = await playback(page);
    assert.ok(now.following && now.playing, JSON.stringify(now));
    await page.keyboard.press('i');
    await page.waitForFunction(() => /the last\d+ s of at most 60 s/.test(document.querySelector('#panel-statistics')?.textContent));
    await page.waitForFunction(() => /memory\d+ MB of at most 256 MB/.test(document.querySelector('#panel-statistics')?.textContent));
    await page.keyboard.press('i');
  },

  async 'it is stopped, and what comes is kept'(page) {
    await page.keyboard.press(' ');
    await inState(page, 'shifted');
    await settled(page);
    const { number } = await surface(page);
    await keptMore(page, 10);
    assert.equal((await surface(page)).number, number);
    await page.waitForSelector('#follow[aria-pressed=false]');
    await page.waitForFunction(() => /−\d+:\d\d/.test(document.querySelector('#timeline')?.textContent));
    await page.waitForFunction(() => document.querySelector('#badge-text')?.textContent === 'Paused');
  },

  async 'a link says the time of day, and whoever has not kept it is told'(page) {
    const link = await page.evaluate(() => window.relievo.link());
    assert.match(link, /&time=\d{4}-\d\d-\d\dT[^&]*Z&play=0$/);
    const other = await open(link.slice(new URL(link).origin.length));
    await inState(other, 'live');
    await other.waitForFunction(() => /is not kept any more/.test(document.querySelector('#source')?.textContent));
    await shownPast(other, 1);
    assert.match(await other.evaluate(() => window.relievo.link()), /&time=live$/);
    await other.close();
  },

  async 'each frame that was is the one it was'(page) {
    feeder.say('stop'); // else the oldest go one by one meanwhile, and the time line is another at each look
    await eventually('more comes all the same', async () => {
      const before = await end(page);
      await page.waitForTimeout(700);
      return (await end(page)) === before;
    });
    const { first, index } = await playback(page);
    await seek(page, index - 4);
    let before = (await surface(page)).number;
    for (const key of ['.', '.', '.']) {
      await press(page, key);
      const { number } = await surface(page);
      assert.ok(number > before, `${number} after ${before}`);
      before = number;
    }
    await page.keyboard.press('c');
    for (const i of [first + 1, index - 2]) {
      await seek(page, i);
      const { number } = await surface(page);
      const { cameraPicture: picture } = await look(page);
      for (const [u, v] of [[0.1, 0.15], [0.85, 0.8]]) {
        const at = [picture.x + u * picture.width, picture.y + v * picture.height];
        const picked = await page.evaluate(([x, y]) => window.relievo.pick(x, y), at);
        assert.ok(Math.abs(picked.point[2] - depthOf(u, v, number)) < 0.0006, `frame ${number}: ${picked.point[2]}`);
      }
    }
    await page.keyboard.press('o');
    await press(page, 'Home');
    assert.equal((await playback(page)).index, first);
    await errors(page);
  },

  async 'what is kept has pictures under the cursor'(page) {
    const { first, index } = await playback(page);
    const seen = await pointAt(page, first + 4);
    assert.ok(seen.deviation > 5, `its picture is flat: ${seen.deviation}`);
    assert.match(seen.time, /^−\d+:\d\d/);
    assert.equal((await playback(page)).index, index, 'looking is no seeking');
    await seek(page, seen.index);
    assert.equal((await surface(page)).number, seen.frame);
    await press(page, 'Home');
    await page.mouse.move(300, 150);
    feeder.say('start ball');
  },

  async 'it plays on behind live'(page) {
    await keptMore(page, 12); // of what was before nothing may be left by now
    await seek(page, (await end(page)) - 12);
    await page.keyboard.press(' ');
    const { shown } = await look(page);
    await shownPast(page, shown + 5);
    const { playing, following, index, first, times } = await playback(page);
    assert.ok(playing && !following);
    assert.ok(index < first + times.length - 5, `at ${index} of ${first + times.length}`);
    await page.waitForFunction(() => document.querySelector('#badge-text')?.textContent === 'Behind live');
    await page.keyboard.press(' ');
    await inState(page, 'shifted');
    await page.waitForTimeout(3000); // what was shown before is no part of it
    await page.waitForFunction(() => /network ?[1-9]/.test(document.querySelector('#statistics')?.textContent)); // what comes is kept
  },

  async 'L is live again'(page) {
    await page.keyboard.press('l');
    await inState(page, 'live');
    const { received, frame } = await look(page);
    // The next one may have been on its way through the decoder, and is then counted already.
    await page.waitForFunction(
      (before) => window.relievo.diagnostics().frame > before.frame && window.relievo.diagnostics().received > before.received,
      { received, frame },
    );
    assert.equal((await playback(page)).following, true);
    assert.equal((await look(page)).drops.gaps, 0);
    await page.waitForFunction(() => window.relievo.diagnostics().latencyMs !== null);
    await errors(page);
  },

  async 'a range gets its start and its end by the button, though more comes meanwhile'(page) {
    const { first, times } = await playback(page);
    const [from, to] = [first + times.length - 6, first + times.length - 2];
    const range = page.locator('#timeline button:text-is("⟲")');
    await seek(page, from);
    await range.click();
    await keptMore(page, 4);
    await seek(page, to);
    await range.click();
    const now = await playback(page);
    const [begin, end] = [from, to].map((index) => now.times[index - now.first]);
    assert.ok(now.loop !== null && Math.abs(now.loop.from - begin) < 1 && Math.abs(now.loop.to - end) < 1, JSON.stringify([now.loop, begin, end]));
    await range.click();
    assert.equal((await playback(page)).loop, null);
    await press(page, 'l');
    await inState(page, 'live');
  },

  async 'the picture under the cursor says how far behind live it is'(page) {
    const { width, height } = await page.locator('#timeline .track').boundingBox();
    for (const share of [0.1, 0.2]) await page.hover('#timeline .track', { position: { x: share * width, y: height / 2 } });
    await page.waitForFunction(() => /−\d+:\d\d/.test(document.querySelector('.preview')?.textContent ?? ''));
    const [minutes, seconds] = /−(\d+):([\d.]+)/.exec(await page.textContent('.preview')).slice(1).map(Number);
    assert.ok(60 * minutes + seconds > 0.5, `${minutes}:${seconds} behind live`);
    assert.equal((await playback(page)).following, true);
    await page.mouse.move(300, 150);
  },

  async 'what plays faster than it comes arrives at live by itself'(page) {
    await page.keyboard.press(' ');
    await inState(page, 'shifted');
    await press(page, ',');
    await page.selectOption('#timeline select[title^="Speed"]', '8');
    await page.evaluate(() => document.querySelector('#view').focus());
    await page.keyboard.press(' ');
    await inState(page, 'live');
    await page.click('#timeline button[title^="Pause"]');
    await inState(page, 'shifted');
    await page.click('#follow');
    await inState(page, 'live');
    await errors(page);
  },

  async 'frames that were lost are marked'(page) {
    const last = await page.evaluate(() => {
      const { first, times } = window.relievo.diagnostics().playback;
      for (const end = performance.now() + 2000; performance.now() < end; );
      return first + times.length - 1;
    });
    await page.waitForFunction((before) => {
      const { first, gaps } = window.relievo.diagnostics().playback;
      return gaps.some((gap, i) => gap > 0 && first + i > before);
    }, last);
    const { link } = (await look(page)).drops;
    assert.ok(link > 0);
    await eventually('no red mark is drawn', async () => (await marksAt(page, '--bad')).some(({ high, ofColour }) => ofColour && high >= 8));
    await page.keyboard.press('i');
    const figure = (name) => page.locator('#panel-statistics dt', { hasText: new RegExp(`^${name}$`) }).locator('xpath=following-sibling::dd[1]').textContent();
    await eventually('the panel does not say how many', async () => Number(await figure('page not ready')) >= link);
    await eventually('the panel says no bit rate', async () => Number(/^([\d.]+) Mbit/.exec(await figure('received'))?.[1]) > 0);
    await page.keyboard.press('i');
  },

  async 'what was is there when the server is gone, and a phone has room for it'(page) {
    await page.setViewportSize({ width: 360, height: 740 });
    await page.waitForFunction(() => document.querySelector('#timeline').getBoundingClientRect().width < 360);
    const outside = () => page.evaluate(() =>
      [...document.querySelectorAll('#timeline *')]
        .filter((e) => e.getClientRects().length > 0 && !e.closest('option'))
        .filter((e) => e.getBoundingClientRect().left < -0.5 || e.getBoundingClientRect().right > innerWidth + 0.5)
        .map((e) => e.id || e.textContent),
    );
    let found;
    await eventually(() => `beside the page: ${found}`, async () => {
      found = await outside();
      return found.length === 0;
    });
    assert.deepEqual(complaints, []);
    await feeder.kill();
    await inState(page, 'lost');
    const { index } = await playback(page);
    await seek(page, index - 3);
    await inState(page, 'shifted');
    await page.waitForFunction(() => / · Offline$/.test(document.querySelector('#badge-text').textContent));
    await page.keyboard.press('b');
    await page.waitForFunction(() => /does not answer/.test(document.querySelector('#quality-why')?.textContent));
    await page.keyboard.press('n');
    await page.waitForSelector('#panel-streams small:has-text("not known")');
    await page.keyboard.press('Escape');
    await page.keyboard.press('l');
    await inState(page, 'lost');
    await errors(page);
  },
};

const onServer = {
  async 'frames that build on a key frame are shown in any order'(page) {
    await shownPast(page, 2);
    await keysAmongOthers(page);
    await page.keyboard.press(' ');
    await inState(page, 'shifted');
    await settled(page);
    const { first, index, keys } = await playback(page);
    assert.ok(keys.some((k) => k === false), 'every frame is a key frame');
    const from = Math.max(first, index - 9);
    await compare(page, Array.from({ length: Math.min(10, index - first) }, (_, i) => from + i));
    await page.keyboard.press('l');
    await inState(page, 'live');
    const { shown } = await look(page);
    await shownPast(page, shown + 8);
    await errors(page);
  },
};

const onVideo = {
  async 'pictures of H.264 are those they were, in any order'(page) {
    await shownPast(page, 2);
    await keysAmongOthers(page);
    await page.keyboard.press('c');
    await page.keyboard.press(' ');
    await inState(page, 'shifted');
    await settled(page);
    const { first, index, keys } = await playback(page);
    assert.ok(keys.some((k) => k === false), 'every frame is a key frame');
    assert.equal((await look(page)).parts.texture > 0 && (await page.isHidden('#notice')), true, 'there is no picture');
    const from = Math.max(first, index - 9);
    const picture = (of) => of.evaluate(async () => (await window.relievo.readPixels()).hash);
    await compare(page, Array.from({ length: Math.min(10, index - first) }, (_, i) => from + i), picture);
    const seen = await pointAt(page, from + 2); // that of the key frame before it
    assert.ok(seen.deviation > 5, `its picture is flat: ${seen.deviation}`);
    await page.mouse.move(300, 150);
    await page.keyboard.press('l');
    await inState(page, 'live');
    const { shown } = await look(page);
    await shownPast(page, shown + 8);
    await errors(page);
  },
};

let failed = 2;
let server = null;
try {
  feeder.say('start ball');
  failed = await runChecks(onFeeder, await open());
  server = await Server.start(serverPath, [...kScene, '--key-interval', '5']);
  const ofServer = pagesOf(browser, server.address, complaints);
  failed += await runChecks(onServer, await ofServer.open());
  if (video === 'h264') {
    await server.kill();
    server = await Server.start(serverPath, [...kScene, '--key-interval', '5', '--texture', 'h264']);
    failed += await runChecks(onVideo, await pagesOf(browser, server.address, complaints).open());
  }
} finally {
  await browser.close();
  await feeder.kill();
  await server?.kill();
}
process.exit(failed === 0 ? 0 : 1);
