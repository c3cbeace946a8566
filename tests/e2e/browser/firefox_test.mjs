// SPDX-License-Identifier: Apache-2.0
// Proves, in Firefox: a stream is seen in its colours, also as H.264, is turned, measured, recorded and taken away, and what
// was recorded is shown.
// Run as: node firefox_test.mjs GATEWAY_FEEDER [h264], in web/viewer. Exit 77: no Firefox here.
import assert from 'node:assert/strict';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { eventually } from './chromium.mjs';
import { colourAt, depthOf, Feeder, inState, look, pagesOf, pickAt, pointOf, runChecks, shownPast, still } from './feeder.mjs';
import { launchFirefox, savedBy } from './firefox.mjs';

const saved = mkdtempSync(join(tmpdir(), 'relievo-firefox-'));
const feeder = await Feeder.start(process.argv[2]);
const browser = await launchFirefox(saved);
const complaints = [];
const { open } = pagesOf(browser, `http://127.0.0.1:${feeder.port}`, complaints);
const kFrame = 62;

/** The texture's corners, which are red and green, are where the camera saw them. */
async function hasItsColours(page, what) {
  const corner = (u) => colourAt(page, pointOf(u, 0.06, kFrame));
  let found;
  await eventually(() => `${what}: the corners are ${found}`, async () => {
    const [[r0, g0], [r1, g1]] = (found = [await corner(0.04), await corner(0.96)]);
    return r0 > 150 && g0 < 90 && g1 > 130 && r1 < 90;
  });
}

const takeAway = (page, name) => savedBy(saved, () => page.click(`#panel-take button:text-is("${name}")`));

const checks = {
  async 'a stream is shown in its colours, the right way round'(page) {
    feeder.say('start ball');
    await inState(page, 'live');
    await shownPast(page, 3);
    await feeder.standStill(page, kFrame);
    await hasItsColours(page, 'JPEG');
  },

  async 'a key chooses how it is drawn, and another turns it'(page) {
    await page.keyboard.press('5');
    await page.waitForFunction(() => window.relievo.diagnostics().mode === 'normals');
    await page.keyboard.press('1');
    const before = await page.evaluate((p) => window.relievo.toPage(p), pointOf(0.2, 0.2, kFrame));
    for (let i = 0; i < 4; ++i) await page.keyboard.press('ArrowLeft');
    await still(page);
    const after = await page.evaluate((p) => window.relievo.toPage(p), pointOf(0.2, 0.2, kFrame));
    assert.ok(Math.abs(after.x - before.x) > 5, `${before.x} px, ${after.x} px`);
    await page.keyboard.press('r');
    await still(page);
  },

  async 'the place under the cursor is the surface\'s'(page) {
    for (const [u, v] of [[0.1, 0.15], [0.5, 0.5], [0.85, 0.8]]) {
      const { point } = await pickAt(page, pointOf(u, v, kFrame));
      assert.ok(Math.abs(point[2] - depthOf(u, v, kFrame)) < 0.002, `${point[2]} m at ${u}, ${v}`);
    }
  },

  async 'a picture, a video and the surface are saved'(page) {
    await page.keyboard.press('t');
    const starts = { Picture: '\x89PNG', PLY: 'ply\n', GLB: 'glTF' };
    for (const [name, start] of Object.entries(starts)) {
      const { bytes } = await takeAway(page, name);
      assert.equal(bytes.toString('latin1', 0, start.length), start, name);
      assert.ok(bytes.length > 10_000, `${name}: ${bytes.length} bytes`);
    }
    feeder.say('start ball');
    await page.click('#panel-take button:text-is("Video")');
    await page.waitForSelector('#panel-take button:text-is("Stop video")');
    await shownPast(page, (await look(page)).shown + 12);
    const { bytes } = await takeAway(page, 'Stop video');
    assert.equal(bytes.readUInt32BE(0), 0x1a45dfa3, 'it is no WebM');
    await page.keyboard.press('Escape');
  },

  async 'what comes is recorded, and shown'(page) {
    await page.click('#tool-record');
    await page.waitForSelector('#tool-record[aria-pressed="true"]');
    await shownPast(page, (await look(page)).shown + 6);
    const { file } = await savedBy(saved, () => page.click('#tool-record'));
    await page.setInputFiles('#file', file);
    await inState(page, 'file');
    await page.waitForFunction(() => window.relievo.diagnostics().playback?.times.length >= 6);
    await page.keyboard.press('End');
    await still(page);
    const { playback, pixels } = await look(page);
    assert.equal(playback.index, playback.times.length - 1);
    assert.ok(pixels.covered > 0.1, `the surface covers ${pixels.covered} of the page`);
  },

  async 'H.264 is shown in its colours'() {
    if (!process.argv.includes('h264')) return console.log('      the programs are built without H.264');
    feeder.say('texture h264');
    feeder.say('start ball');
    const page = await open('/?stream=ball');
    await inState(page, 'live');
    await shownPast(page, 10);
    await feeder.standStill(page, kFrame);
    await hasItsColours(page, 'H.264');
    await page.close();
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
  rmSync(saved, { recursive: true, force: true });
}
process.exit(failed === 0 ? 0 : 1);
