// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium against `relievo-server serve`: beside the surface stand the camera's picture, the
// stripes, or both; of what is live the stripes are the camera's own picture of them, of what was they are drawn where
// the surface says that they were read; tools, panels and time line cover nothing of each other. Run as: in_own_domain node split_test.mjs RELIEVO_SERVER [SCREENSHOTS], in
// web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import { eventually, launchChromium } from './chromium.mjs';
import { inState, look, pagesOf, runChecks, shownPast, still } from './feeder.mjs';
import { Server } from './server.mjs';

const [serverPath, screenshots] = process.argv.slice(2);
const kStripes = 60;
const kRead = [90, 230, 255];

const server = await Server.start(serverPath, ['--source', `sim:plane,width=320,height=240,stripes=${kStripes},rate=10`, '--stream', 'plane']);
const browser = await launchChromium();
const complaints = [];
const { open } = pagesOf(browser, server.address, complaints);

const split = (page) => page.evaluate(() => document.body.dataset.split);
const note = (page, of) => page.waitForFunction((words) => document.querySelector('#stripes-note')?.textContent.includes(words), of);
/** Of a picture on the page: its share of pixels of a saturated colour, those of kRead, and how often the hue changes in the middle line. */
const colours = (page, id) =>
  page.evaluate(
    ([of, read]) => {
      const canvas = document.querySelector(of);
      const { width, height } = canvas;
      const { data } = canvas.getContext('2d').getImageData(0, 0, width, height);
      const hue = (at) => {
        const rgb = [data[at], data[at + 1], data[at + 2]];
        const [least, most] = [Math.min(...rgb), Math.max(...rgb)];
        return most > 40 && least < 0.6 * most ? rgb.map((c) => (c > (least + most) / 2 ? 1 : 0)).join('') : null;
      };
      let [saturated, marked, changes, before] = [0, 0, 0, null];
      for (let at = 0; at < data.length; at += 4) {
        saturated += hue(at) === null ? 0 : 1;
        marked += read.every((c, i) => data[at + i] === c) ? 1 : 0;
      }
      const hues = Array.from({ length: width }, (_, x) => hue(4 * ((height >> 1) * width + x)));
      for (let x = 2; x < width; ++x) {
        const now = hues[x];
        if (now === null || hues[x - 1] !== now || hues[x - 2] !== now) continue; // between two stripes
        changes += before !== null && now !== before ? 1 : 0;
        before = now;
      }
      return { width, height, saturated: saturated / (width * height), marked, changes };
    },
    [id, kRead],
  );

/** Where these are on the page, whose parts follow each other when one changes. */
const boxesOf = (page, selectors) =>
  page.evaluate(
    (all) =>
      all.map((of) => {
        const { left, top, right, bottom } = document.querySelector(of).getBoundingClientRect();
        return { left, top, right, bottom };
      }),
    selectors,
  );

const checks = {
  async 'the stripes are what the camera sees of them'(page) {
    await shownPast(page, 2);
    await page.keyboard.press('v');
    assert.equal(await split(page), 'picture');
    assert.ok(!(await page.isVisible('#stripes')), 'stripes that nobody asked for');
    await page.keyboard.press('v');
    assert.equal(await split(page), 'stripes');
    assert.ok(!(await page.isVisible('#picture')));
    await note(page, 'as the camera sees them');
    const seen = await colours(page, '#stripes');
    assert.deepEqual([seen.width, seen.height], [320, 240]);
    assert.ok(seen.saturated > 0.6, `${seen.saturated} of the picture is coloured`);
    // The whole width of the wall is lit by most of the stripes.
    assert.ok(seen.changes > 0.4 * kStripes && seen.changes <= 1.2 * kStripes, `${seen.changes} changes of colour`);
    const { shown } = await look(page);
    await shownPast(page, shown + 3); // the stream goes on meanwhile
  },

  async 'both stand beside the surface, and nothing covers anything'(page) {
    await page.keyboard.press('v');
    assert.equal(await split(page), 'both');
    let boxes;
    const areApart = (a, b) => a.right <= b.left + 1 || b.right <= a.left + 1 || a.bottom <= b.top + 1 || b.bottom <= a.top + 1;
    const isWhole = (a) => a.right - a.left > 100 && Math.abs((a.right - a.left) / (a.bottom - a.top) - 4 / 3) < 0.02;
    await eventually(() => JSON.stringify(boxes), async () => {
      boxes = await boxesOf(page, ['#picture', '#stripes', '#view', '#rail', '#timeline', 'header .segments']);
      return boxes.slice(0, 2).every((a, i) => isWhole(a) && boxes.slice(i + 1).every((b) => areApart(a, b)));
    });
    const [picture, stripes] = [await colours(page, '#picture'), await colours(page, '#stripes')];
    assert.ok(picture.saturated < 0.5 * stripes.saturated, `the texture is coloured too: ${picture.saturated}`);
    if (screenshots) await page.screenshot({ path: join(screenshots, 'split.png') });
  },

  async 'of what was they are drawn where they were read'(page) {
    await page.keyboard.press(' ');
    await inState(page, 'shifted');
    await note(page, 'Where stripes were read');
    await still(page); // one may have been on its way
    const { vertices } = await look(page);
    const { marked } = await colours(page, '#stripes');
    // Two vertices may lie in one pixel.
    assert.ok(vertices > 3000 && marked > 0.9 * vertices && marked <= vertices, `${marked} of ${vertices}`);
    if (screenshots) await page.screenshot({ path: join(screenshots, 'split-read.png') });
    await page.keyboard.press('l');
    await inState(page, 'live');
    await note(page, 'as the camera sees them');
  },

  async 'a panel covers neither tools nor time line, however small the page is'(page) {
    await page.keyboard.press('?');
    let boxes;
    await eventually(() => JSON.stringify(boxes), async () => {
      boxes = await boxesOf(page, ['#panel-help', '#rail', '#timeline', '#modes']);
      const [panel, ...others] = boxes;
      return panel.bottom - panel.top > 150 && others.every((other) => panel.right <= other.left || panel.bottom <= other.top);
    });
    await page.keyboard.press('Escape');
  },

  async 'it is chosen by name too, kept, and part of links'(page) {
    await page.keyboard.press('b');
    await page.selectOption('#panel-display label:has-text("Beside the surface") select', { label: 'The stripes' });
    assert.equal(await split(page), 'stripes');
    assert.match(await page.evaluate(() => window.relievo.link()), /split=stripes/);
    await page.reload();
    await shownPast(page, 1);
    assert.equal(await split(page), 'stripes');
    await note(page, 'as the camera sees them');
  },

  async 'stripes that cannot be loaded are asked for again'() {
    const page = await open('/', { serviceWorkers: 'block' }); // as on plain http from elsewhere
    let refused = 0;
    await page.route(/\/stripes-/, (route) => (++refused > 2 ? route.continue() : route.abort()));
    for (const key of ['v', 'v']) await page.keyboard.press(key);
    await note(page, 'as the camera sees them');
    await page.close();
    assert.deepEqual(complaints.splice(0).filter((c) => !/ERR_FAILED/.test(c)), []); // what the browser says of a file that does not come
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
  await server.kill();
}
process.exit(failed === 0 ? 0 : 1);
