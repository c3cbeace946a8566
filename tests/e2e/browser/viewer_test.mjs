// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium: the page shows a live surface (pixels, not blank, moving), says honestly what state
// it is in, and asks no other host for anything. Run as: node viewer_test.mjs GATEWAY_FEEDER [SCREENSHOT_FOLDER],
// in web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { mkdirSync, mkdtempSync, rmSync } from 'node:fs';
import { connect, createServer } from 'node:net';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { eventually, launchChromium } from './chromium.mjs';
import { Feeder, inState, loaded, look, pagesOf, shownPast } from './feeder.mjs';
import { withoutWebGl } from './web.mjs';

const [feederPath, shotsWanted] = process.argv.slice(2);

const scratch = mkdtempSync(join(tmpdir(), 'relievo-browser-'));
const shots = shotsWanted ?? join(scratch, 'shots');
mkdirSync(shots, { recursive: true });
let feeder = await Feeder.start(feederPath);
const origin = `http://127.0.0.1:${feeder.port}`;
const browser = await launchChromium();
const complaints = [];

const { newPage, open } = pagesOf(browser, origin, complaints);

const more = async (page, frames) => shownPast(page, (await look(page)).shown + frames);
/** Until the card says so: the reason may come behind the state. */
const cardSays = (page, words) =>
  page.waitForFunction(([source, flags]) => new RegExp(source, flags).test(document.querySelector('#card:not([hidden])')?.textContent), [words.source, words.flags]);
const inMode = (page, mode) =>
  page.waitForFunction((wanted) => window.relievo.diagnostics().mode === wanted, mode);
const hash = (page) => page.evaluate(async () => (await window.relievo.readPixels()).hash);
/** Until the picture stays as it is: what was under way has arrived, and no motion is left. */
async function steady(page) {
  await eventually('the picture does not come to rest', async () => {
    const before = await look(page);
    await page.waitForTimeout(700);
    const after = await look(page);
    return !after.busy && after.received === before.received && after.drawn === before.drawn && after.pixels.hash === before.pixels.hash;
  });
}

/** As a browser treats a tab in the background: its pages have no screen to draw for. */
const hide = () => {
  window.later_ = [];
  window.atOnce_ = window.requestAnimationFrame;
  window.requestAnimationFrame = (call) => window.later_.push(call);
  Object.defineProperty(document, 'hidden', { configurable: true, get: () => true });
  document.dispatchEvent(new Event('visibilitychange'));
};
const show = () => {
  window.requestAnimationFrame = window.atOnce_;
  for (const call of window.later_) window.requestAnimationFrame(call);
  delete document.hidden;
  document.dispatchEvent(new Event('visibilitychange'));
};

const kCovered = 0.1; // of the page at least, by a surface that is seen whole in what the page's parts leave free

const checks = {
  async 'an empty server says how to start a stream'(page) {
    assert.equal(await page.title(), 'Relievo');
    await inState(page, 'empty');
    await cardSays(page, /No streams yet.*relievo-server serve --source sim:face/s);
    assert.equal((await look(page)).pixels.covered, 0);
  },

  async 'a stream that starts appears by itself, live'(page) {
    feeder.say('start ball');
    await shownPast(page, 3);
    await page.waitForFunction(
      () =>
        window.relievo.diagnostics().state === 'live' &&
        document.querySelector('#card').hidden &&
        document.title === 'Relievo · ball',
    );
    const now = await look(page);
    assert.ok(now.pixels.covered > kCovered, `the surface covers ${now.pixels.covered} of the page`);
    assert.ok(now.pixels.deviation > 10, `the picture is flat: ${now.pixels.deviation}`);
    assert.ok(now.vertices > 10_000 && now.triangles > 20_000, `${now.vertices}, ${now.triangles}`);
    assert.equal(now.errors, 0, now.lastError);
    assert.equal(now.drops.gaps, 0);
  },

  async 'the picture moves and the frame counter grows'(page) {
    const first = await look(page);
    await more(page, 4);
    const second = await look(page);
    assert.ok(second.frame > first.frame);
    assert.notEqual(second.pixels.hash, first.pixels.hash);
    await page.waitForFunction(() =>
      /frame\d+rate[\d.]+ \/slatency\d+ ms/.test(document.querySelector('#statistics')?.textContent),
    );
    await page.waitForFunction(() => window.relievo.diagnostics().latencyMs > 0);
  },

  async 'the texture is on the right way round'(page) {
    // The feeder paints the texture's upper left corner red and its upper right one green.
    const find = async () => {
      const png = (await page.screenshot()).toString('base64');
      return page.evaluate(async (data) => {
        const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
        const bitmap = await createImageBitmap(new Blob([bytes]));
        const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
        const context = canvas.getContext('2d');
        context.drawImage(bitmap, 0, 0);
        const { data: rgba } = context.getImageData(0, 0, bitmap.width, bitmap.height);
        const centre = (match) => {
          let [n, sx, sy] = [0, 0, 0];
          for (let i = 0; i < rgba.length; i += 4) {
            if (!match(rgba[i], rgba[i + 1], rgba[i + 2])) continue;
            ++n;
            sx += ((i / 4) % bitmap.width) / bitmap.width;
            sy += Math.floor(i / 4 / bitmap.width) / bitmap.height;
          }
          return { n, x: sx / n, y: sy / n };
        };
        return {
          red: centre((r, g, b) => r > 180 && g < 70 && b < 70),
          green: centre((r, g, b) => r < 70 && g > 150 && b < 70),
        };
      }, png);
    };
    let corners;
    await eventually(
      () => `no two corners, or not where they belong: ${JSON.stringify(corners)}`,
      async () => {
        corners = await find(); // again where the stream had just stalled, and the picture was dimmed
        const { red, green } = corners;
        return red.n > 300 && green.n > 300 && red.x < 0.45 && red.y < 0.4 && green.x > 0.55 && green.y < 0.4;
      },
    );
  },

  async 'keys and buttons choose how the surface is drawn'(page) {
    const hashes = new Set();
    feeder.say('stop'); // the same surface in each mode: also those that the worker prepared nothing for
    await steady(page);
    for (const [key, mode] of [['2', 'shaded'], ['3', 'wireframe'], ['4', 'points'], ['1', 'textured']]) {
      await page.keyboard.press(key);
      await inMode(page, mode);
      const now = await look(page);
      assert.ok(now.pixels.covered > 0.03, `${mode} covers ${now.pixels.covered}`);
      hashes.add(now.pixels.hash);
      await page.screenshot({ path: join(shots, `${mode}.png`) });
    }
    assert.equal(hashes.size, 4);
    await page.click('#modes button:nth-child(2)');
    await inMode(page, 'shaded');
    assert.equal(await page.getAttribute('#modes button:nth-child(2)', 'aria-pressed'), 'true');
    await page.keyboard.press('1');
  },

  async 'keys, mouse and wheel move the view, R brings it back'(page) {
    await inMode(page, 'textured');
    await page.keyboard.press('r'); // the first view of the surface as it is now
    await steady(page);
    const home = await hash(page);
    const moved = async (what, act) => {
      const before = await hash(page);
      await act();
      await eventually(`${what} did nothing`, async () => (await hash(page)) !== before);
    };
    await moved('an arrow key', () => page.keyboard.press('ArrowLeft'));
    await moved('shift and an arrow key', () => page.keyboard.press('Shift+ArrowUp'));
    await moved('plus', () => page.keyboard.press('+'));
    await moved('the wheel', async () => {
      await page.mouse.move(400, 250);
      await page.mouse.wheel(0, 240);
    });
    await moved('a drag', async () => {
      await page.mouse.down();
      await page.mouse.move(480, 270, { steps: 4 });
      await page.mouse.up();
    });
    await page.keyboard.press('r');
    await eventually('R does not bring the first view back', async () => (await hash(page)) === home);
  },

  async 'nothing is drawn while nothing changes'(page) {
    await steady(page);
  },

  async 'on a screen of other pixels what stands still is drawn anew'(page) {
    feeder.say('stop');
    await steady(page);
    const { width, height } = page.viewportSize();
    const screen = await page.context().newCDPSession(page);
    for (const deviceScaleFactor of [2, 1]) {
      const { drawn } = await look(page);
      await screen.send('Emulation.setDeviceMetricsOverride', { width, height, deviceScaleFactor, mobile: false });
      await page.waitForFunction((n) => window.relievo.diagnostics().drawn > n, drawn);
      await page.waitForFunction((pixels) => document.querySelector('#overlay').width === pixels, width * deviceScaleFactor);
    }
    await screen.detach();
  },

  async 'a silent stream is called stalled and dimmed'(page) {
    await inState(page, 'stalled');
    await cardSays(page, /stalled/);
    assert.ok(await page.evaluate(() => document.body.classList.contains('dim')));
    if (shotsWanted) await page.waitForTimeout(600);
    await page.screenshot({ path: join(shots, 'stalled.png') });
    feeder.say('start ball');
    await inState(page, 'live');
    feeder.say('status stalled No signal from the camera.');
    await inState(page, 'stalled');
    await cardSays(page, /No signal from the camera\./);
    feeder.say('status running');
    await inState(page, 'live');
  },

  async 'a corrupt frame is counted and the next ones are shown'(page) {
    // One may be dropped on the way, like any frame this page is too slow for.
    await eventually('no corrupt frame was counted', async () => {
      feeder.say('corrupt');
      await page.waitForTimeout(500);
      return (await look(page)).errors > 0;
    });
    await more(page, 4);
    assert.match((await look(page)).lastError, /frame is cut short/);
    await page.waitForFunction(() => /errors\d/.test(document.querySelector('#statistics')?.textContent));
  },

  async 'in the background it receives nothing, is not called stalled, and records on'(page) {
    const other = await open(); // says how much time passes
    await shownPast(other, 1);
    const received = async () => (await look(page)).received;
    await more(page, 2);
    await page.evaluate(hide);
    await more(other, 4); // what was on its way has come
    const before = await received();
    await more(other, 25); // longer than a stream may be silent
    assert.ok((await received()) - before <= 1, `received ${(await received()) - before}`);
    assert.equal((await look(page)).state, 'live');
    await page.evaluate(show);
    await more(page, 3);
    await page.keyboard.press('x');
    await page.waitForFunction(() => /\d MB/.test(document.querySelector('#recording').textContent));
    await page.evaluate(hide);
    const start = await received();
    await eventually('what is recorded does not come', async () => (await received()) > start + 20);
    await page.evaluate(show);
    const saved = page.waitForEvent('download');
    await page.keyboard.press('x');
    await saved;
    await more(page, 2);
    await other.close();
  },

  async 'an ended and a vanished stream are told apart from a stall'(page) {
    feeder.say('status ended The take is at its end.');
    await inState(page, 'ended');
    await cardSays(page, /The take is at its end\./);
    feeder.say('gone');
    await page.waitForFunction(() => /left the network/.test(document.querySelector('#card')?.textContent));
    feeder.say('start ball');
    await inState(page, 'live');
  },

  async 'far from its server it gets the frames that there are, not two in each round trip'(resting) {
    await resting.goto('about:blank'); // until it is needed again it draws nothing
    const kWay_ms = 600;
    const late = createServer((near) => {
      const far = connect(feeder.port, '127.0.0.1');
      for (const [from, to] of [[near, far], [far, near]]) {
        from.on('data', (data) => void setTimeout(() => to.write(data), kWay_ms));
        from.on('close', () => to.destroy()).on('error', () => to.destroy());
      }
    });
    await new Promise((listening) => late.listen(0, '127.0.0.1', listening));
    feeder.say('start ball');
    const page = await newPage({ viewport: { width: 400, height: 300 } });
    await page.goto(`http://127.0.0.1:${late.address().port}/`);
    await shownPast(page, 1);
    // Two would be 1.7 a second, of 8 that there are; a slow machine draws few more.
    await eventually('no more come than two in a round trip', async () => {
      const { received } = await look(page);
      await page.waitForTimeout(4000);
      return (await look(page)).received - received > 10;
    });
    await page.close();
    late.close();
  },

  async 'a stream that does not exist is waited for'() {
    const page = await open('/?stream=later');
    await inState(page, 'waiting');
    await cardSays(page, /Waiting for “later”/);
    await page.waitForFunction(() => document.querySelectorAll('#streams option').length === 2);
    await page.selectOption('#streams', 'ball');
    await inState(page, 'live');
    assert.match(page.url(), /stream=ball/);
    await page.close();
  },

  async 'a phone sees everything without scrolling sideways'() {
    const page = await open('/', { viewport: { width: 360, height: 740 }, hasTouch: true });
    await shownPast(page, 2);
    await page.waitForSelector('#timeline', { state: 'visible' });
    const outside = () => page.evaluate(() =>
      [...document.querySelectorAll('header *, footer *')]
        .filter((e) => e.getClientRects().length > 0 && !e.closest('svg, option'))
        .filter((e) => e.getBoundingClientRect().left < -0.5 || e.getBoundingClientRect().right > innerWidth + 0.5)
        .map((e) => e.id || e.textContent),
    );
    let found;
    await eventually(() => `beside the page: ${found}`, async () => {
      found = await outside(); // parts follow each other
      return found.length === 0;
    });
    await page.screenshot({ path: join(shots, 'phone.png') });
    await page.close();
  },

  async 'in a low window drops are seen, and no number of the grid runs under the time line'() {
    const page = await open('/', { viewport: { width: 844, height: 390 }, hasTouch: true });
    await shownPast(page, 2);
    await page.waitForSelector('#timeline', { state: 'visible' });
    const seen = () => page.evaluate(() => {
      const box = (e) => e.getBoundingClientRect();
      const line = box(document.querySelector('#statistics'));
      const cells = [...document.querySelectorAll('#statistics div')].filter((cell) => box(cell).top >= line.top - 1 && box(cell).bottom <= line.bottom + 1 && box(cell).right <= line.right);
      const overlay = document.querySelector('#overlay');
      const scale = overlay.width / overlay.clientWidth;
      const under = (e) => {
        const { x, y, width, height } = box(e);
        const { data } = overlay.getContext('2d').getImageData(x * scale, y * scale, width * scale, height * scale);
        return data.some((value, i) => i % 4 === 3 && value > 0);
      };
      const all = overlay.getContext('2d').getImageData(0, 0, overlay.width, overlay.height).data;
      return {
        cells: cells.map((cell) => cell.firstElementChild.textContent),
        numbers: all.some((value, i) => i % 4 === 3 && value > 0),
        under: ['#timeline', '#modes', '#statistics', '#rail'].filter((part) => under(document.querySelector(part))),
      };
    });
    let found;
    await eventually(() => `it is ${JSON.stringify(found)}`, async () => {
      found = await seen();
      return found.cells.includes('drops') && found.cells.includes('latency') && found.numbers && found.under.length === 0;
    });
    await page.close();
  },

  async 'no number of the grid runs under an open panel, and what a source is called leaves room for the stream\'s name'() {
    const page = await open('/', { viewport: { width: 1100, height: 700 } });
    await shownPast(page, 2);
    const under = (part) => page.evaluate((selector) => {
      const { x, y, width, height } = document.querySelector(selector).getBoundingClientRect();
      const overlay = document.querySelector('#overlay');
      const scale = overlay.width / overlay.clientWidth;
      const { data } = overlay.getContext('2d').getImageData(x * scale, y * scale, width * scale, height * scale);
      return data.some((value, i) => i % 4 === 3 && value > 0);
    }, part);
    // How far the surface and its numbers go with a key depends on where the ball is: in some places all are beside the page.
    const movedPast = async (part, key, times) => {
      let seen = 0;
      for (let moved = 0; moved < times; ++moved) {
        for (let i = 0; i < 4; ++i) await page.keyboard.press(key);
        await more(page, 2);
        await eventually(`numbers run under ${part}, moved ${moved} times`, async () => !(await under(part)));
        if (await under('body')) ++seen;
      }
      assert.ok(seen >= times / 2, `of ${times} times numbers were seen ${seen}`);
    };
    await page.keyboard.press('b');
    await page.waitForSelector('#panel-display', { state: 'visible' });
    await movedPast('#panel-display', 'Shift+ArrowLeft', 6); // what is seen goes to the right
    await page.keyboard.press('Escape');
    await page.keyboard.press('6');
    await page.waitForSelector('#legend', { state: 'visible' });
    await movedPast('#legend', 'Shift+ArrowRight', 8);
    await page.setViewportSize({ width: 844, height: 390 });
    const cut = await page.evaluate(() => {
      const [source, select] = [document.querySelector('#source'), document.querySelector('#streams')];
      source.textContent = 'a camera that is called by many words '.repeat(4);
      const whole = select.cloneNode(true);
      Object.assign(whole.style, { position: 'absolute', maxWidth: 'none' });
      select.after(whole);
      const missing = whole.offsetWidth - select.offsetWidth;
      whole.remove();
      return missing;
    });
    assert.ok(cut <= 0, `${cut} pixels of the stream's name are cut off`);
    await page.close();
  },

  async 'where the footer is hidden behind a panel numbers of the grid have its room'() {
    const page = await open('/', { viewport: { width: 390, height: 844 }, hasTouch: true });
    await shownPast(page, 2);
    await page.keyboard.press('n');
    await page.waitForSelector('#panel-streams', { state: 'visible' });
    const between = () => page.evaluate(async () => {
      await new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)));
      const { x, y, width } = document.querySelector('#timeline').getBoundingClientRect();
      const height = document.querySelector('#panel-streams').getBoundingClientRect().top - y;
      const overlay = document.querySelector('#overlay');
      const scale = overlay.width / overlay.clientWidth;
      const { data } = overlay.getContext('2d').getImageData(x * scale, y * scale, width * scale, height * scale);
      return data.some((value, i) => i % 4 === 3 && value > 0);
    });
    await eventually('no number comes into the room of the footer', async () => {
      if (await between()) return true;
      await page.keyboard.press('Shift+ArrowUp'); // what is seen goes down
      return false;
    });
    await page.close();
  },

  async 'without WebGL the page says so'() {
    const page = await newPage();
    await withoutWebGl(page);
    await page.goto(origin);
    await inState(page, 'unsupported');
    await cardSays(page, /WebGL 2/);
    await page.close();
  },

  async 'the page draws by itself where workers do not, also after the driver took the picture away'(page) {
    await page.goto(origin);
    await shownPast(page, 1);
    const workers = page.workers().length;
    const near = await newPage({ viewport: { width: 800, height: 500 } });
    const warnings = [];
    near.on('console', (message) => warnings.push(message.text()));
    await near.addInitScript(() => delete HTMLCanvasElement.prototype.transferControlToOffscreen);
    await near.goto(origin);
    await loaded(near);
    await more(near, 2);
    assert.equal(near.workers().length, workers - 1, 'a worker draws');
    assert.ok((await look(near)).pixels.covered > kCovered);
    await near.evaluate(() => (window.taken = document.querySelector('#view').getContext('webgl2').getExtension('WEBGL_lose_context')).loseContext());
    await inState(near, 'unsupported');
    await cardSays(near, /took the picture away/);
    await near.evaluate(() => window.taken.restoreContext());
    await inState(near, 'live');
    await more(near, 2);
    for (const key of ['3', '7', '1']) {
      await near.keyboard.press(key);
      await more(near, 2);
      assert.ok((await look(near)).pixels.covered > kCovered / (key === '3' ? 4 : 1), `mode ${key}`);
    }
    assert.deepEqual(warnings.filter((text) => /does not belong/.test(text)), []);
    await near.close();
  },

  async 'until here: no error, no request to another host'() {
    // Chromium tells of what the server refuses: that it has no folder of recordings.
    assert.deepEqual(complaints.filter((c) => !/status of 404/.test(c)), []);
  },

  async 'a lost server is noticed, and found again'(page) {
    const { port } = feeder;
    await feeder.kill();
    await inState(page, 'lost');
    await cardSays(page, /Connection lost/);
    await page.waitForFunction(() => /in \d+ s/.test(document.querySelector('#card-text')?.textContent));
    if (shotsWanted) await page.waitForTimeout(600);
    await page.screenshot({ path: join(shots, 'lost.png') });
    feeder = await Feeder.restart(feederPath, port);
    feeder.say('start ball');
    page.click('#retry').catch(() => undefined); // not waited for: it may have tried by itself meanwhile
    await inState(page, 'live');
    await more(page, 2);
  },
};

let failed = 0;
try {
  const page = await open();
  for (const [name, check] of Object.entries(checks)) {
    const start = Date.now();
    try {
      await check(page);
      console.log(`ok    ${name} (${Date.now() - start} ms)`);
    } catch (error) {
      ++failed;
      console.log(`FAIL  ${name}: ${error.message}`);
      console.log('      ', JSON.stringify(await page.evaluate(() => window.relievo?.diagnostics()).catch(() => null)));
      await page.screenshot({ path: join(shots, `failed-${failed}.png`) }).catch(() => undefined);
    }
  }
} finally {
  await browser.close();
  await feeder.kill();
  if (failed === 0 || shotsWanted) rmSync(scratch, { recursive: true, force: true });
  else console.log(`pictures of the failures: ${shots}`);
}
console.log(failed === 0 ? 'all checks passed' : `${failed} of ${Object.keys(checks).length} checks failed`);
process.exit(failed === 0 ? 0 : 1);
