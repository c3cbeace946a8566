// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium: who uses a keyboard or a screen reader gets at all of the page: each control of each
// panel has a name, the tabulator reaches them and shows where it is; the sheet lists the keys; times are told since
// the start and by the day; what was measured is copied; in forced colours it shows what is chosen; and in small windows, and
// where the browser writes larger, no part lies over another or is cut off.
// Run as: node access_test.mjs GATEWAY_FEEDER, in web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { eventually, launchChromium } from './chromium.mjs';
import { Feeder, inState, look, pagesOf, pointOf, restingPlace, runChecks, shownPast, still } from './feeder.mjs';

const [feederPath] = process.argv.slice(2);
const feeder = await Feeder.start(feederPath);
const browser = await launchChromium();
const complaints = [];
const { open } = pagesOf(browser, `http://127.0.0.1:${feeder.port}`, complaints);
const kPanels = { b: 'display', n: 'streams', m: 'measure', i: 'statistics', t: 'take', '?': 'help' };
const kFrame = 62;

/** What a person can press or set, and how it is called; those without a name. */
const nameless = (page) =>
  page.evaluate(() => {
    const isShown = (e) => e.checkVisibility({ visibilityProperty: true });
    const words = (e) => [...(e.labels ?? [])].map((l) => l.textContent).join(' ') || e.textContent;
    const name = (e) => e.getAttribute('aria-label') ?? (words(e) || e.title);
    const controls = [...document.querySelectorAll('button, input, select, a[href], [role=slider]')].filter(isShown);
    return { count: controls.length, without: controls.filter((e) => !/\p{L}|\d/u.test(name(e))).map((e) => e.outerHTML.slice(0, 120)) };
  });

/** No part of the page lies over another, or is cut off. */
async function fits(page, what) {
  const wrong = () => page.evaluate(() => {
    const box = (e) => e.getBoundingClientRect();
    const parts = [...document.querySelectorAll('header > *, footer > *, #rail, #legend')].filter((e) => e.getClientRects().length > 0);
    const name = (e) => e.id || e.textContent || e.tagName;
    // What lies in a row that is scrolled is brought into sight first.
    const isCut = (e) => {
      e.scrollIntoView({ block: 'nearest', inline: 'nearest' });
      return box(e).right > innerWidth + 0.5 || box(e).bottom > innerHeight + 0.5;
    };
    const isCovered = (e) => {
      e.scrollIntoView({ block: 'nearest', inline: 'nearest' });
      const { left, top, width: across, height: high } = box(e);
      return !e.contains(document.elementFromPoint(left + across / 2, top + high / 2));
    };
    const buttons = [...document.querySelectorAll('header button, footer button, #rail button')].filter((e) => e.getClientRects().length > 0);
    const overlap = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
    return {
      cut: [...parts, ...buttons].filter(isCut).map(name),
      covered: buttons.filter(isCovered).map(name),
      over: parts.flatMap((a, i) => parts.slice(i + 1).filter((b) => overlap(box(a), box(b))).map((b) => `${name(a)}, ${name(b)}`)),
    };
  });
  let found;
  await eventually(() => `${what}: ${JSON.stringify(found)}`, async () => {
    found = await wrong(); // parts follow the header
    return found.cut.length + found.covered.length + found.over.length === 0;
  });
}

const checks = {
  async 'each control of each panel has a name'(page) {
    await shownPast(page, 3);
    assert.equal(await page.getAttribute('html', 'lang'), 'en');
    const bare = await nameless(page);
    assert.ok(bare.count > 20, `${bare.count} controls`);
    assert.deepEqual(bare.without, []);
    for (const [key, name] of Object.entries(kPanels)) {
      await page.keyboard.press(key);
      await page.waitForSelector(`#panel-${name}`, { state: 'visible' });
      assert.equal(await page.getAttribute(`#tool-${name}`, 'aria-expanded'), 'true');
      await page.waitForSelector(`#panel-${name} .body > *`, { state: 'attached' }); // what is in it may be loaded only now
      assert.deepEqual((await nameless(page)).without, [], name);
      await page.keyboard.press('Escape');
      await page.waitForSelector(`#panel-${name}`, { state: 'hidden' });
    }
  },

  async 'the tabulator reaches tools, modes and time line, and shows where it is'(page) {
    await page.focus('#view');
    const reached = new Set();
    for (let i = 0; i < 60; ++i) {
      await page.keyboard.press('Tab');
      const at = await page.evaluate(() => {
        const e = document.activeElement;
        const { outlineStyle, outlineWidth, boxShadow } = getComputedStyle(e);
        const part = e.closest('#ways, #rail, #modes, #timeline')?.id ?? '';
        return { part, isMarked: (outlineStyle !== 'none' && parseFloat(outlineWidth) > 0) || boxShadow !== 'none', html: e.outerHTML.slice(0, 100) };
      });
      if (at.part === '') continue;
      assert.ok(at.isMarked, `nothing shows that the focus is on ${at.html}`);
      reached.add(at.part);
    }
    assert.deepEqual([...reached].sort(), ['modes', 'rail', 'timeline', 'ways']);
  },

  async 'the tabulator goes from where a panel is opened into it, and escape back'(page) {
    const focused = () => page.evaluate(() => document.activeElement.closest('#panels aside, #view, button, select')?.id ?? document.activeElement.outerHTML.slice(0, 80));
    for (const [from, key, name] of [['#view', 'b', 'display'], ['#view', 'n', 'streams'], ['#tool-measure', 'Enter', 'measure'], ['#modes button:first-child', 't', 'take']]) {
      await page.focus(from);
      const before = await focused();
      await page.keyboard.press(key);
      await page.waitForSelector(`#panel-${name}`, { state: 'visible' });
      assert.equal(await focused(), before, `${name} takes the focus by itself`);
      await page.keyboard.press('Tab');
      assert.equal(await page.evaluate(() => document.activeElement.closest('aside')?.id), `panel-${name}`, `from ${from}`);
      await page.keyboard.press('Escape');
      await page.waitForSelector(`#panel-${name}`, { state: 'hidden' });
      assert.ok(await page.evaluate((of) => document.activeElement.matches(of), from), `not back at ${from}, but at ${await focused()}`);
    }
    // From elsewhere it goes on as the page is made, so that nothing is out of reach while a panel is open.
    await page.keyboard.press('b');
    await page.focus('#ways button:last-child');
    await page.keyboard.press('Tab');
    assert.equal(await page.evaluate(() => document.activeElement.parentElement.id), 'rail');
    await page.keyboard.press('Escape');
  },

  async 'a mode is chosen by the keyboard alone'(page) {
    await page.focus('#modes button:nth-child(5)');
    await page.keyboard.press('Enter');
    await page.waitForFunction(() => window.relievo.diagnostics().mode === 'normals');
    assert.equal(await page.getAttribute('#modes button:nth-child(5)', 'aria-pressed'), 'true');
    await page.focus('#view');
    await page.keyboard.press('1');
  },

  async 'a slider goes to its ends by Home and End, which leave the time alone'(page) {
    await page.keyboard.press('b');
    const slider = page.locator('#panel-display input[type=range]');
    await slider.focus();
    for (const [key, to] of [['End', 'max'], ['Home', 'min']]) {
      await page.keyboard.press(key);
      assert.equal(await slider.inputValue(), await slider.getAttribute(to), key);
    }
    assert.equal((await page.evaluate(() => window.relievo.diagnostics())).playback.following, true);
    await page.keyboard.press('Escape');
  },

  async 'the sheet lists the keys'(page) {
    await page.keyboard.press('?');
    await page.waitForSelector('#panel-help', { state: 'visible' });
    const keys = (await page.locator('#panel-help dt').allTextContents()).join(' ');
    for (const key of ['R', 'O Y C', 'G', 'V', 'F', 'H', 'Space', '[ ]', 'Home End', 'L', 'X', 'B', 'M', 'N', 'I', 'T']) assert.ok(keys.includes(key), `${key} is not in ${keys}`);
    await page.keyboard.press('Escape');
  },

  async 'times are since the start, and of the day'(page) {
    await page.waitForSelector('#timeline .time', { state: 'visible' });
    await page.focus('#view');
    await page.keyboard.press(' ');
    await inState(page, 'shifted');
    assert.match(await page.textContent('#timeline .time'), /^[−-]?\d+:\d\d\.\d{3}$/);
    await page.click('#timeline .time');
    await page.waitForFunction(() => /\d\d:\d\d:\d\d/.test(document.querySelector('#timeline .time')?.textContent)); // on the screen's beat
    const shown = /(\d\d):(\d\d):(\d\d)/.exec(await page.textContent('#timeline .time'));
    const since = (Number(shown[1]) * 60 + Number(shown[2])) * 60 + Number(shown[3]);
    const now = (Date.now() / 1000) % 86_400;
    assert.ok((now - since + 86_400) % 86_400 < 600, `${shown[0]} is not of these minutes`);
    await page.click('#timeline .time');
    await page.focus('#view');
    await page.keyboard.press('l');
    await inState(page, 'live');
  },

  async 'what was measured is copied'(page) {
    await page.context().grantPermissions(['clipboard-read', 'clipboard-write']);
    await page.focus('#view');
    await page.keyboard.press('l'); // wherever the check before left it
    await inState(page, 'live');
    await feeder.standStill(page, kFrame);
    await page.keyboard.press('m');
    await page.click('#panel-measure .segments button:text-is("Point")');
    await still(page);
    const at = await restingPlace(page, pointOf(0.15, 0.2, kFrame));
    await page.mouse.click(at.x, at.y);
    await page.waitForFunction(() => window.relievo.diagnostics().measurements.length === 1);
    const { value } = (await look(page)).measurements[0];
    await page.click('#panel-measure button:text-is("Copy")');
    await eventually('nothing is on the clipboard', async () => /^tool\t/.test(await page.evaluate(() => navigator.clipboard.readText())));
    const [names, cells] = (await page.evaluate(() => navigator.clipboard.readText())).trim().split('\n').map((line) => line.split('\t'));
    assert.equal(cells[0], 'point');
    assert.ok(Math.abs(Number(cells[names.findIndex((n) => /^value/.test(n))]) - value) < 1e-5, `${names}: ${cells}`);
  },

  async 'what goes takes the focus nowhere'(page) {
    const focused = () => page.evaluate(() => document.activeElement.closest('#panel-measure, #view')?.id ?? document.activeElement.outerHTML.slice(0, 80));
    await page.focus('#panel-measure .measurements button');
    await page.keyboard.press('Enter');
    await page.waitForFunction(() => window.relievo.diagnostics().measurements.length === 0);
    assert.equal(await focused(), 'panel-measure');
    await page.keyboard.press('h');
    await page.waitForSelector('#panel-measure', { state: 'hidden' });
    assert.equal(await focused(), 'view');
    await page.keyboard.press('h');
    await page.waitForSelector('#panel-measure', { state: 'visible' });
    await page.close(); // what follows has pages of its own
  },

  async 'in forced colours it shows what is chosen, and what says something by its colour keeps it'() {
    feeder.say('start ball');
    const page = await open('/', { viewport: { width: 1280, height: 760 }, forcedColors: 'active' });
    await shownPast(page, 2);
    await page.keyboard.press('n');
    await page.keyboard.press('7');
    const pressed = ['#modes [aria-pressed=true]', '#ways [aria-pressed=true]', '#tool-streams[aria-expanded=true]', '.streams [aria-pressed=true]', '#follow[aria-pressed=true]'];
    const swatches = ['#badge i', '#legend canvas', '#legend i'];
    // The list is asked for as its panel opens, and the time line comes with its second frame.
    await page.waitForFunction((all) => all.every((of) => document.querySelector(of) !== null), [...pressed, ...swatches]);
    const { chosen, others, kept } = await page.evaluate(([on, coloured]) => {
      const ground = (of) => getComputedStyle(document.querySelector(of)).backgroundColor;
      return {
        chosen: on.map(ground),
        others: ['#modes [aria-pressed=false]', '#tool-measure'].map(ground),
        kept: coloured.map((of) => getComputedStyle(document.querySelector(of)).forcedColorAdjust),
      };
    }, [pressed, swatches]);
    assert.equal(new Set(chosen).size, 1, `${chosen}`);
    assert.ok(!others.includes(chosen[0]), `${chosen[0]} is that of ${others}, too`);
    assert.ok(kept.every((adjust) => adjust === 'none'), `${kept}`);
    await page.focus('#view');
    assert.equal(await page.evaluate(() => getComputedStyle(document.querySelector('#view')).outlineStyle), 'solid', 'shadows are not drawn');
    await page.close();
  },

  async 'on plain http a link is copied without taking the keyboard from its button'() {
    feeder.say('start ball');
    const page = await open();
    await shownPast(page, 2);
    await page.evaluate(() => Object.defineProperty(navigator, 'clipboard', { value: undefined }));
    await page.keyboard.press('t');
    const link = page.locator('#panel-take button', { hasText: 'Copy link' });
    await link.focus();
    await page.keyboard.press('Enter');
    await page.waitForFunction(() => document.querySelector('#panel-take [role=status]').textContent !== '');
    assert.ok(await link.evaluate((e) => e === document.activeElement), 'the keyboard is elsewhere');
    await page.close();
  },

  async 'for who asks for more contrast words and edges are clearer'() {
    feeder.say('start ball');
    for (const colorScheme of ['dark', 'light']) {
      const page = await open('/', { viewport: { width: 1280, height: 760 }, colorScheme, contrast: 'more' });
      await shownPast(page, 2);
      await page.waitForSelector('#statistics dt');
      const { words, text, edges } = await page.evaluate(() => {
        const of = (selector) => getComputedStyle(document.querySelector(selector));
        // Of 0 to 255, as it is seen on the part's ground.
        const drawn = (...colours) => {
          const context = new OffscreenCanvas(1, 1).getContext('2d');
          for (const colour of colours) {
            context.fillStyle = colour;
            context.fillRect(0, 0, 1, 1);
          }
          return [...context.getImageData(0, 0, 1, 1).data.slice(0, 3)];
        };
        const luminance = (rgb) => rgb.map((v) => v / 255).map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)).reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
        const contrast = (a, b) => (Math.max(luminance(a), luminance(b)) + 0.05) / (Math.min(luminance(a), luminance(b)) + 0.05);
        const edges = ['#timeline', '#rail', '#modes'].map((part) => {
          const { backgroundColor, borderTopColor } = of(part);
          return contrast(drawn(backgroundColor, borderTopColor), drawn(backgroundColor));
        });
        return { words: of('#statistics dt').color, text: of('body').color, edges };
      });
      assert.equal(words, text);
      assert.ok(edges.every((ratio) => ratio >= 3), `${colorScheme}: ${edges}`);
      await page.close();
    }
  },

  async 'in small windows no part lies over another or is cut off'() {
    feeder.say('also a-stream-whose-name-is-as-long-as-a-name-of-a-stream-can-be-here');
    const streams = ['ball', 'a-stream-whose-name-is-as-long-as-a-name-of-a-stream-can-be-here'];
    for (const [width, height] of [[360, 640], [650, 700], [700, 500], [740, 360], [568, 320], [320, 256]]) {
      const page = await open(`/?stream=${streams[width === 700 ? 1 : 0]}`, { viewport: { width, height } });
      await shownPast(page, 2);
      await page.keyboard.press('6');
      await page.keyboard.press('x');
      for (const part of ['#recording', '#legend', '#timeline']) await page.waitForSelector(part, { state: 'visible' });
      await fits(page, `${width}x${height}`);
      await page.close();
    }
  },

  async 'in rows that are scrolled what is chosen is in sight, however it was chosen'() {
    const page = await open('/?stream=ball#mode=confidence', { viewport: { width: 320, height: 400 } });
    await shownPast(page, 1);
    const inSight = (chosen) =>
      page.waitForFunction((words) => {
        const row = document.querySelector('#modes');
        const button = row.querySelector('[aria-pressed=true]');
        const [{ left, right }, { left: from, right: to }] = [button, row].map((e) => e.getBoundingClientRect());
        return row.scrollWidth > row.clientWidth && button.textContent === words && left >= from && right <= to;
      }, chosen);
    await inSight('Confidence');
    await page.keyboard.press('1');
    await inSight('Textured');
    await page.setViewportSize({ width: 1000, height: 700 });
    await page.click('#modes button:text-is("Confidence")');
    await page.setViewportSize({ width: 320, height: 400 });
    await inSight('Confidence');
    await page.close();
  },

  async 'beside a panel in a low window the time line has its buttons in one row'() {
    const page = await open('/?stream=ball', { viewport: { width: 800, height: 360 } });
    await shownPast(page, 2);
    await page.keyboard.press('m');
    await page.waitForSelector('#panel-measure .segments');
    await page.waitForFunction(() => {
      const buttons = [...document.querySelectorAll('#timeline > button')].filter((e) => e.getClientRects().length > 0);
      return buttons.length > 5 && new Set(buttons.map((e) => Math.round(e.getBoundingClientRect().top))).size === 1;
    });
    await page.close();
  },

  async 'who has their browser write larger gets all of it larger, and still no part over another'() {
    for (const size_px of [16, 24, 32]) {
      const large = await launchChromium([`--blink-settings=defaultFontSize=${size_px}`]);
      try {
        const { open: openLarge } = pagesOf(large, `http://127.0.0.1:${feeder.port}`, complaints);
        for (const [width, height] of [[1440, 900], [390, 844]]) {
          const page = await openLarge('/?stream=ball', { viewport: { width, height } });
          await shownPast(page, 2);
          await page.keyboard.press('6');
          for (const part of ['#legend', '#timeline']) await page.waitForSelector(part, { state: 'visible' });
          const sizes = await page.evaluate(() => ['#badge', '#timeline', '#overlay'].map((of) => parseFloat(getComputedStyle(document.querySelector(of)).fontSize)));
          assert.deepEqual(sizes.map((px) => Math.round((px * 16) / size_px)), [13, 12, 11], `${sizes}`);
          await fits(page, `letters of ${size_px}, ${width}x${height}`);
          for (const [key, name] of Object.entries(kPanels)) {
            await page.keyboard.press(key);
            await page.waitForSelector(`#panel-${name} .body > *`, { state: 'attached' });
            const { scrollWidth, clientWidth } = await page.evaluate((of) => {
              const { scrollWidth, clientWidth } = document.querySelector(of);
              return { scrollWidth, clientWidth };
            }, `#panel-${name}`);
            assert.ok(scrollWidth <= clientWidth + 1, `letters of ${size_px}, ${width}x${height}: ${name} is ${scrollWidth} px wide in ${clientWidth}`);
            await page.keyboard.press('Escape');
          }
          await page.close();
        }
      } finally {
        await large.close();
      }
    }
  },

  async 'all that is on the page is in its main part or its footer'() {
    feeder.say('start ball');
    const page = await open();
    await shownPast(page, 2);
    assert.equal(await page.locator('main').count(), 1);
    const outside = await page.evaluate(() => [...document.body.children].filter((e) => e.checkVisibility() && !e.matches('main, footer')).map((e) => e.outerHTML.slice(0, 80)));
    assert.deepEqual(outside, []);
    await page.close();
  },

  async 'without JavaScript the page says so, and nothing else'() {
    const context = await browser.newContext({ javaScriptEnabled: false });
    const page = await context.newPage();
    for (const path of ['/', '/rig']) {
      const response = await page.goto(`http://127.0.0.1:${feeder.port}${path}`);
      if (response.status() === 404) continue; // a gateway without a rig
      const shown = await page.locator('body').innerText();
      assert.match(shown.trim(), /^This page needs JavaScript[^\n]*$/, path);
    }
    await context.close();
  },

  async 'no error, no request to another host'() {
    // Chromium tells of what the server refuses: that it has no folder of recordings.
    assert.deepEqual(complaints.filter((c) => !/status of 404/.test(c)), []);
  },
};

let failed = 1;
try {
  feeder.say('start ball');
  failed = await runChecks(checks, await open('/', { viewport: { width: 1280, height: 760 } }));
} finally {
  await browser.close();
  await feeder.kill();
}
process.exit(failed === 0 ? 0 : 1);
