// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium: the list shows each stream with its picture, and a second stream stands beside the first
// where the page says it does, by a button and by the address, until it is taken away or another one is chosen.
// Run as: node streams_test.mjs GATEWAY_FEEDER, in web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { launchChromium } from './chromium.mjs';
import { Feeder, inState, kPicture, look, pagesOf, pointOf, runChecks, shownPast, still } from './feeder.mjs';

const feeder = await Feeder.start(process.argv[2]);
const browser = await launchChromium();
const complaints = [];
const { open } = pagesOf(browser, `http://127.0.0.1:${feeder.port}`, complaints);
const kFrame = 62;

const besides = (page, count) =>
  page.waitForFunction((n) => window.relievo.diagnostics().besides.filter((b) => b.shown > 0).length === n, count);
const rowOf = (name) => `.streams li:has(b:text-is("${name}"))`;
/** Colours of the surface's upper corners, red and green, that stand `right` metres beside the first one. */
async function corners(page, right) {
  const { frame } = await look(page);
  const colours = [];
  for (const u of [30 / kPicture.width, 1 - 30 / kPicture.width]) {
    const [x, y, z] = pointOf(u, 30 / kPicture.height, frame);
    const at = await page.evaluate((p) => window.relievo.toPage(p), [x + right, y, z]);
    colours.push(await page.evaluate(([px, py]) => window.relievo.pixelAt(px, py), [at.x, at.y]));
  }
  return colours;
}
async function assertStands(page, right) {
  const [[r, g, b], [r2, g2, b2]] = await corners(page, right);
  assert.ok(r > 150 && g < 90 && b < 90, `no red at ${right} m: ${[r, g, b]}`);
  assert.ok(r2 < 90 && g2 > 130 && b2 < 90, `no green at ${right} m: ${[r2, g2, b2]}`);
}

const checks = {
  async 'each stream is listed, with its picture'(page) {
    await shownPast(page, 2);
    await page.keyboard.press('n');
    await page.waitForFunction(() => document.querySelectorAll('.streams canvas[data-drawn]').length === 2);
    for (const name of ['ball', 'other']) {
      const [r, g] = await page.evaluate((row) => {
        const canvas = document.querySelector(row).querySelector('canvas');
        return [...canvas.getContext('2d').getImageData(canvas.width * 0.04, canvas.height * 0.05, 1, 1).data];
      }, `.streams li:nth-child(${name === 'ball' ? 1 : 2})`);
      assert.ok(r > 150 && g < 90, `the picture of ${name} is not its texture: ${r}, ${g}`);
    }
    assert.equal(await page.getAttribute(`${rowOf('ball')} button:text-is("Show")`, 'aria-pressed'), 'true');
    assert.match(await page.textContent(rowOf('other')), /feeder:ball/);
  },

  async 'a second one stands beside the first, with a gap'(page) {
    await page.click(`${rowOf('other')} button:text-is("Beside")`);
    await besides(page, 1);
    assert.match(page.url(), /\?stream=ball,other$/);
    assert.match(await page.textContent('#panel-streams'), /does not say where one rig stands to another/);
    await page.keyboard.press('Escape');
    feeder.say(`frame ${kFrame}`); // both from here on
    await page.waitForFunction((n) => {
      const now = window.relievo.diagnostics();
      return now.frame === n && now.besides[0].frame === n;
    }, kFrame);
    await still(page);
    const { besides: [{ right, extent }] } = await look(page);
    const width = extent.max[0] - extent.min[0];
    assert.ok(right > width && right < 1.4 * width, `${right} m, of a surface ${width} m wide`);
    await assertStands(page, 0);
    await assertStands(page, right);
    assert.equal((await look(page)).besides[0].errors, 0);
  },

  async 'modes are for all of them, the rig\'s camera for its own'(page) {
    const { besides: [{ right }] } = await look(page);
    await page.keyboard.press('6');
    await still(page);
    const [one, other] = [await corners(page, 0), await corners(page, right)];
    for (const i of [0, 1]) for (const c of [0, 1, 2]) assert.ok(Math.abs(one[i][c] - other[i][c]) < 12, `${one}, ${other}`);
    await page.keyboard.press('1');
    await page.keyboard.press('c');
    await still(page);
    const alone = await page.evaluate(() => window.relievo.readPixels());
    await page.keyboard.press('o');
    await page.keyboard.press('r');
    await still(page);
    assert.ok(alone.covered > 0.5 && alone.covered < 0.9, `covers ${alone.covered}`); // 4:3 in 8:5
  },

  async 'in one frame, and taken away'(page) {
    await page.keyboard.press('n');
    await page.selectOption('#panel-streams select', 'together');
    await page.waitForFunction(() => window.relievo.diagnostics().besides[0].right === 0);
    await page.click(`${rowOf('other')} button:text-is("Beside")`);
    await page.waitForFunction(() => window.relievo.diagnostics().besides.length === 0);
    assert.match(page.url(), /\?stream=ball$/);
    await page.keyboard.press('Escape');
  },

  async 'an address and a link open both'() {
    feeder.say('start ball');
    const page = await open('/?stream=ball,other');
    await inState(page, 'live');
    await besides(page, 1);
    assert.match(await page.evaluate(() => window.relievo.link()), /\?stream=ball(,|%2C)other#/);
    await page.keyboard.press('n');
    await page.click(`${rowOf('other')} button:text-is("Show")`);
    await page.waitForFunction(() => window.relievo.diagnostics().stream === 'other');
    assert.deepEqual((await look(page)).besides, []);
    await inState(page, 'live');
    await page.close();
  },

  async 'no error, no request to another host'() {
    // Chromium tells of what the server refuses: that it has no folder of recordings.
    assert.deepEqual(complaints.filter((c) => !/status of 404/.test(c)), []);
  },
};

let failed = 1;
try {
  feeder.say('start ball');
  feeder.say('also other');
  failed = await runChecks(checks, await open('/?stream=ball', { viewport: { width: 1200, height: 750 } }));
} finally {
  await browser.close();
  await feeder.kill();
}
process.exit(failed === 0 ? 0 : 1);
