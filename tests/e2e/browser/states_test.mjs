// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium: in each state that is not live (empty, loading, stalled, error, reconnecting) the page
// says in words what is the matter, on a card that covers no control and is not cut off, on desktops and phones, dark and
// light; the button on it can be reached by keys. A panel whose part cannot be loaded says so, and is tried again. With
// a folder: makes the pictures of docs/viewer.md there.
// Run as: in_own_domain node states_test.mjs GATEWAY_FEEDER RELIEVO_SERVER [SCREENSHOTS], in web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import { eventually, launchChromium } from './chromium.mjs';
import { Feeder, inState, pagesOf, runChecks, shownPast } from './feeder.mjs';
import { Server } from './server.mjs';
import { makeSheet } from './sheet.mjs';
import { withoutWebGl } from './web.mjs';

const [feederPath, serverPath, screenshots] = process.argv.slice(2);
const kDesktop = { viewport: { width: 1000, height: 640 } };
const kPhone = { viewport: { width: 390, height: 780 }, hasTouch: true };
const kAllLooks = {
  'desktop-dark': { ...kDesktop, colorScheme: 'dark' },
  'desktop-light': { ...kDesktop, colorScheme: 'light' },
  'phone-dark': { ...kPhone, colorScheme: 'dark' },
  'phone-light': { ...kPhone, colorScheme: 'light' },
};
// What is checked is where things are: each size and each theme once suffices.
const kChecked = ['desktop-light', 'phone-dark'];
const kLooks = screenshots ? kAllLooks : Object.fromEntries(kChecked.map((look) => [look, kAllLooks[look]]));
let feeder = await Feeder.start(feederPath);
const origin = `http://127.0.0.1:${feeder.port}`;
const browser = await launchChromium();
const complaints = [];
const { newPage, open } = pagesOf(browser, origin, complaints);
const taken = new Map(Object.keys(kLooks).map((look) => [look, []])); // name of the state and picture

/** Pages of each look, as `make` opens them; closed by inspect(). */
const pages = async (make) => {
  const made = [];
  for (const [look, options] of Object.entries(kLooks)) made.push({ look, page: await make(options) });
  return made;
};

async function inspect(name, made, said) {
  for (const { look, page } of made) {
    const seen = () => page.evaluate(() => {
      const box = (e) => e.getBoundingClientRect();
      const overlap = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
      const element = document.querySelector('#card');
      const at = box(element);
      const controls = [...document.querySelectorAll('header > *, footer > *, #rail, #panels aside')].filter((e) => e.getClientRects().length > 0);
      return {
        card: !element.hidden,
        inside: at.left >= 0 && at.top >= 0 && at.right <= innerWidth && at.bottom <= innerHeight && element.scrollWidth <= element.clientWidth,
        covered: controls.filter((e) => overlap(box(e), at)).map((e) => e.id || e.className || e.tagName),
        words: element.textContent,
      };
    });
    // The page's parts follow each other, and what the server says of it may come behind the state.
    let found;
    await eventually(() => `${name}, ${look}: the card is cut off, covers controls, or says something else: ${JSON.stringify(found)}`, async () => {
      found = await seen();
      return found.card && found.inside && found.covered.length === 0 && said.test(found.words);
    });
    if (screenshots && taken.has(look)) {
      await page.waitForTimeout(600); // what is dimmed fades
      taken.get(look).push({ name, png: (await page.screenshot()).toString('base64') });
    }
    await page.close();
  }
}

const checks = {
  async 'loading: the server does not answer yet'() {
    const made = await pages(async (options) => {
      const page = await newPage(options);
      await page.addInitScript(() => (AbortSignal.timeout = () => new AbortController().signal)); // it waits, however long this takes
      await page.route('**/api/streams', () => undefined);
      await page.goto(origin);
      await inState(page, 'connecting');
      return page;
    });
    await inspect('Loading', made, /Asking the server/);
  },

  async 'empty: no streams, no recordings'() {
    const made = await pages(async (options) => {
      const page = await open('/', options);
      await inState(page, 'empty');
      return page;
    });
    await inspect('Empty', made, /No streams yet.*relievo-server serve/s);
  },

  async 'opening a recording of the address, which then is not there'() {
    let answer;
    const asked = new Promise((resolve) => (answer = resolve));
    const made = await pages(async (options) => {
      const page = await newPage(options);
      const asks = new Promise((resolve) => {
        page.route('**/recordings/none.mcap', async (route) => {
          resolve();
          await asked;
          await route.continue();
        });
      });
      const listed = page.waitForResponse('**/api/streams');
      await page.goto(`${origin}/?recording=none.mcap`);
      await Promise.all([asks, listed]);
      return page;
    });
    const says = (words) => Promise.all(made.map(({ page }) => page.waitForFunction((w) => document.querySelector('#card-title').textContent === w, words)));
    await says('Opening none.mcap');
    answer();
    await says('“none.mcap” cannot be shown');
    for (const { page } of made) await page.close();
  },

  async 'waiting for a stream by its name'() {
    const made = await pages(async (options) => {
      const page = await open('/?stream=later', options);
      await inState(page, 'waiting');
      return page;
    });
    await inspect('Waiting', made, /Waiting for “later”/);
  },

  async 'starting: announced, without a frame'() {
    feeder.say('announce ball');
    const made = await pages(async (options) => {
      const page = await open('/', options);
      await inState(page, 'starting');
      return page;
    });
    await inspect('Starting', made, /first frame/);
  },

  async 'a card about a file stays under the hand when the first picture comes'() {
    const page = await open('/', kDesktop); // nothing has come yet
    await inState(page, 'starting');
    await page.setInputFiles('#file', { name: 'notes.mcap', mimeType: 'text/plain', buffer: Buffer.from('some words') });
    await page.waitForSelector('#dismiss:visible');
    await page.hover('#dismiss'); // once it does not move any more
    const box = await page.locator('#dismiss').boundingBox();
    feeder.say('start ball');
    await page.waitForFunction(() => document.body.classList.contains('seen'));
    await shownPast(page, 3);
    assert.deepEqual(await page.locator('#dismiss').boundingBox(), box);
    await page.click('#dismiss');
    await page.waitForSelector('#card', { state: 'hidden' });
    await page.close();
  },

  async 'stalled, with the reason'() {
    feeder.say('start ball');
    const made = await pages(async (options) => {
      const page = await open('/', options);
      await shownPast(page, 1);
      return page;
    });
    feeder.say('stop\nstatus stalled No signal from the camera.');
    for (const { page } of made) await inState(page, 'stalled');
    await inspect('Stalled', made, /stalled.*No signal from the camera/s);
  },

  async 'stalled, while a panel is open: beside it, on a phone above it'() {
    feeder.say('start ball\nstatus running');
    const made = [];
    for (const [width, height] of [[844, 390], [1000, 560], [660, 700], [390, 800], [360, 640]]) {
      const page = await open('/', { viewport: { width, height } });
      await shownPast(page, 1);
      await page.keyboard.press('i');
      await page.waitForSelector('#panel-statistics .plot');
      made.push({ look: `${width}x${height}`, page });
    }
    feeder.say('stop\nstatus stalled No signal from the camera.');
    for (const { page } of made) await inState(page, 'stalled');
    await inspect('Stalled beside a panel', made, /stalled.*No signal from the camera/s);
  },

  async 'ended'() {
    feeder.say('start ball\nstatus running');
    const made = await pages(async (options) => {
      const page = await open('/', options);
      await shownPast(page, 1);
      return page;
    });
    feeder.say('stop\nstatus ended The take is at its end.');
    for (const { page } of made) await inState(page, 'ended');
    await inspect('Ended', made, /ended.*at its end/s);
  },

  async 'error: a file that is none'() {
    feeder.say('start ball\nstatus running');
    const made = await pages(async (options) => {
      const page = await open('/', options);
      await shownPast(page, 1);
      await page.setInputFiles('#file', { name: 'notes.mcap', mimeType: 'text/plain', buffer: Buffer.from('some words') });
      await page.waitForSelector('#dismiss:visible');
      await page.focus('#dismiss');
      return page;
    });
    await inspect('A file that is none', made, /“notes.mcap” cannot be shown/);
  },

  async 'error: no WebGL'() {
    const made = await pages(async (options) => {
      const page = await newPage(options);
      await withoutWebGl(page);
      await page.goto(origin);
      await inState(page, 'unsupported');
      return page;
    });
    await inspect('No WebGL', made, /WebGL 2/);
  },

  async 'no error in the page until here'() {
    assert.deepEqual(complaints, []);
  },

  async 'refused: a name that no stream can have, with those there are'() {
    feeder.say('start ball\nstatus running');
    const made = await pages(async (options) => {
      const page = await open(`/?stream=${encodeURIComponent('<b>x</b>')}`, options);
      await inState(page, 'refused');
      await page.waitForSelector('#streams option[value="ball"]', { state: 'attached' });
      return page;
    });
    await inspect('A name that is none', made, /No stream can have this name/);
  },

  async 'refused: all places are taken, until one is free'() {
    const server = await Server.start(serverPath, ['--source', 'sim:object,width=320,height=240,stripes=60,rate=6', '--max-clients', '1']);
    const [made, first] = [[], await newPage(kDesktop)];
    await first.goto(server.address);
    await shownPast(first, 1);
    for (const [look, options] of Object.entries(kLooks)) {
      const page = await newPage(options);
      await page.goto(server.address);
      await page.waitForFunction(() => document.querySelector('#card-title').textContent === 'All places are taken');
      await page.waitForSelector('#streams option[value="object"]', { state: 'attached' });
      made.push({ look, page });
    }
    const waiting = await newPage(kDesktop);
    await waiting.goto(server.address);
    await inState(waiting, 'lost');
    await inspect('Full', made, /All places are taken.*no more pages/s);
    await first.close();
    await shownPast(waiting, 1);
    await waiting.close();
    await server.kill();
  },

  async 'reconnecting, and found again'() {
    const made = await pages(async (options) => {
      const page = await open('/', options);
      await shownPast(page, 1);
      return page;
    });
    await feeder.kill();
    for (const { page } of made) {
      await inState(page, 'lost');
      await page.waitForSelector('#retry:visible');
      await page.focus('#retry');
    }
    await inspect('Reconnecting', made, /Connection lost.*last picture.*Trying again/s);
  },

  async 'a panel that cannot be loaded says so, and is tried again'() {
    const { port } = feeder;
    feeder = await Feeder.restart(feederPath, port);
    feeder.say('start ball');
    // Nothing is kept of the page's parts, as where it is not in a secure context.
    const page = await newPage({ viewport: { width: 1000, height: 640 }, serviceWorkers: 'block' });
    await page.goto(origin);
    await shownPast(page, 1);
    await feeder.kill();
    const names = ['streams', 'statistics', 'take'];
    for (const name of names) {
      await page.click(`#tool-${name}`);
      await page.waitForSelector(`#panel-${name} .failed button:visible`);
      assert.match(await page.textContent(`#panel-${name} .failed`), /cannot be loaded.*server.*Try again/s);
      await page.focus(`#panel-${name} .failed button`);
      await page.evaluate(() => document.activeElement.toggleAttribute('old'));
      await page.keyboard.press('Enter'); // in vain
      await page.waitForSelector(`#panel-${name} .failed button:focus:not([old])`);
    }
    feeder = await Feeder.restart(feederPath, port);
    feeder.say('start ball');
    for (const name of names) {
      if (!(await page.isVisible(`#panel-${name}`))) await page.click(`#tool-${name}`);
      await eventually(`${name} is not tried again`, () =>
        page.evaluate((n) => {
          const body = document.querySelector(`#panel-${n} .body`);
          body.querySelector('.failed button')?.click(); // opened again, it was tried again: it may be there already
          return body.querySelector('.failed') === null && body.childElementCount > 0;
        }, name),
      );
      assert.ok((await page.textContent(`#panel-${name} .body`)).length > 20, `${name} is empty`);
    }
    await page.close();
  },
};

let failed = 1;
try {
  failed = await runChecks(checks, await newPage());
  if (screenshots) for (const [look, states] of taken) await makeSheet(newPage, join(screenshots, `viewer-states-${look}.jpg`), look, states);
} finally {
  await browser.close();
  await feeder.kill();
}
process.exit(failed === 0 ? 0 : 1);
