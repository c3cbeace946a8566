// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium against `relievo-server serve`: the page /rig shows what the camera sees; its
// figures are right where the scene is known (a plane is covered and its colours are told, an over-exposed
// one is clipped, a dark one is dark); frames are looked at only while somebody asks; it drives the projector
// of a server that allows it. Run as: in_own_domain node rig_test.mjs RELIEVO_SERVER [SCREENSHOTS], in
// web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { existsSync, readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';

import { eventually, kPatienceMs, launchChromium } from './chromium.mjs';
import { Screen } from './screen.mjs';
import { Server } from './server.mjs';

const [serverPath, screenshots] = process.argv.slice(2);
const kScene = 'width=320,height=240,stripes=60,rate=10';
const kPictures = ['camera', 'complement', 'exposure', 'coverage', 'order', 'difference', 'boundaries'];

const get = (server, path) => fetch(server.address + path);
/** A look that was made because of this. */
async function look(server, stream) {
  let found;
  await eventually(`no look at ${stream}`, async () => {
    found = await (await get(server, `/api/rig/${stream}`)).json();
    return found.state === 'measured';
  });
  return found;
}
async function withServer(options, use, environment) {
  const server = await Server.start(serverPath, options, environment);
  try {
    await use(server);
  } finally {
    await server.kill();
  }
}
const scene = (name) => ['--source', `sim:${name}`, '--stream', 'rig'];

const browser = await launchChromium();
const complaints = [];
async function open(address, options = {}) {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, ...options });
  const page = await context.newPage();
  page.setDefaultTimeout(kPatienceMs);
  page.on('pageerror', (error) => complaints.push(error.message));
  page.on('console', (message) => message.type() === 'error' && complaints.push(message.text()));
  await page.goto(address);
  return page;
}
const figure = (page, name) => page.textContent(`[data-figure=${name}]`);
const live = (page) =>
  page.waitForFunction(() => document.body.dataset.state === 'live' && document.querySelector('#picture').dataset.shows);
/** Mean red, green, blue of the picture that is shown. */
const mean = (page) =>
  page.evaluate(() => {
    const canvas = document.querySelector('#picture');
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    const sum = [0, 0, 0];
    for (let i = 0; i < data.length; i += 4) for (let c = 0; c < 3; ++c) sum[c] += data[i + c];
    return { width: canvas.width, height: canvas.height, rgb: sum.map((s) => (4 * s) / data.length) };
  });
const show = async (page, name) => {
  await page.click(`#pictures button:nth-child(${kPictures.indexOf(name) + 1})`);
  await page.waitForFunction((n) => document.querySelector('#picture').dataset.shows === n, name);
};

const checks = {
  async 'a plane: covered, in order, its colours told'() {
    await withServer(scene(`plane,${kScene}`), async (server) => {
      const seen = await look(server, 'rig');
      assert.equal(seen.exposure.clipped, 0);
      assert.ok(seen.coverage.share > 0.97, `coverage ${seen.coverage.share}`);
      assert.ok(seen.coverage.lit > 0.97, `lit ${seen.coverage.lit}`);
      assert.equal(seen.boundaries.order_errors, 0);
      assert.ok(seen.boundaries.neighbours > 5000, `${seen.boundaries.neighbours} neighbours`);
      assert.equal(seen.margins.length, 6);
      for (const m of seen.margins) assert.ok(m.pieces > 100 && m.low > 60 && m.wrong === 0, JSON.stringify(m));
      assert.deepEqual(seen.advice, []);
      const values = 2 * 320 * 120; // two fields
      for (const bins of Object.values(seen.exposure.histogram))
        assert.equal(
          bins.reduce((a, b) => a + b),
          values,
        );

      const page = await open(`${server.address}/rig`);
      await live(page);
      assert.equal(await figure(page, 'clipped'), '0.0 %');
      assert.match(await figure(page, 'coverage'), /^(9[7-9]|100) %$/);
      const camera = await mean(page);
      assert.deepEqual([camera.width, camera.height], [320, 240]);
      await show(page, 'coverage');
      const { rgb } = await mean(page);
      assert.ok(rgb[1] > 1.5 * rgb[0] && rgb[1] > 1.5 * rgb[2], `the plane is not green: ${rgb}`);
      const before = await page.textContent('#state');
      await page.waitForFunction((text) => document.querySelector('#state')?.textContent !== text, before);
      for (const name of kPictures) await show(page, name);
      assert.ok((await page.textContent('#advice')).includes('Nothing'));
      if (screenshots) await shots(server.address, 'plane');
      await page.context().close();
    });
  },

  async 'too much light is said, and painted red'() {
    await withServer(scene(`plane,${kScene},exposure=3`), async (server) => {
      const seen = await look(server, 'rig');
      assert.ok(seen.exposure.clipped > 0.9, `clipped ${seen.exposure.clipped}`);
      assert.match(seen.advice[0], /clipped: expose shorter/);
      const page = await open(`${server.address}/rig#exposure`);
      await page.waitForFunction(() => document.querySelector('#picture').dataset.shows === 'exposure');
      const { rgb } = await mean(page);
      assert.ok(rgb[0] > 200 && rgb[1] < 80, `clipped pixels are not red: ${rgb}`);
      await page.waitForSelector('[data-figure=clipped].bad');
      await page.context().close();
    });
  },

  async 'too little light is said; a look comes only where one was asked for'() {
    await withServer(scene(`object,${kScene},exposure=0.15`), async (server) => {
      assert.deepEqual(await (await get(server, '/api/rig/rig')).json(), { state: 'waiting' });
      const seen = await look(server, 'rig');
      assert.ok(seen.exposure.dark > 0.5, `dark ${seen.exposure.dark}`);
      assert.match(seen.advice[0], /expose longer/);
      assert.deepEqual(seen.pictures, [], 'pictures that nobody asked for are drawn');
      assert.equal((await get(server, '/api/rig/rig/order.jpg')).status, 503);
      await eventually('no picture', async () => (await get(server, '/api/rig/rig/order.jpg')).status === 200);
      const jpeg = new Uint8Array(await (await get(server, '/api/rig/rig/order.jpg')).arrayBuffer());
      assert.deepEqual([...jpeg.slice(0, 2)], [0xff, 0xd8]);
    });
  },

  async 'wrong requests are refused with what would be right'() {
    await withServer(scene(`plane,${kScene}`), async (server) => {
      for (const [path, status, says] of [
        ['/api/rig/other', 404, /no such stream/],
        ['/api/rig/rig?pictures=camera,sound', 400, /no picture 'sound': ask for camera, complement/],
        ['/api/rig/rig/sound.jpg', 400, /ask for camera/],
      ]) {
        const response = await get(server, path);
        assert.equal(response.status, status, path);
        assert.match(await response.text(), says);
      }
      const post = (headers, body) => fetch(`${server.address}/api/projector`, { method: 'POST', headers, body });
      const start = JSON.stringify({ action: 'start', stream: 'rig' });
      assert.equal((await post({ 'content-type': 'text/plain' }, start)).status, 415);
      assert.equal((await post({ 'content-type': 'application/json', origin: 'http://elsewhere.example' }, start)).status, 403);
      const refused = await post({ 'content-type': 'application/json' }, start);
      assert.equal(refused.status, 404);
      assert.match(await refused.text(), /start it with --projector/);
      const page = await open(`${server.address}/rig`);
      await page.waitForFunction(() => document.querySelector('#projector').dataset.state === 'none');
      assert.equal(await page.isVisible('#projector button'), false);
      await page.context().close();
    });
  },

  async 'the projector is driven from the page'() {
    const screen = await Screen.start(1024, 768); // as the simulated rig's projector
    try {
      await withServer(
        [...scene(`plane,${kScene}`), '--projector', 'auto'],
        async (server) => {
          const page = await open(`${server.address}/rig`);
          await live(page);
          await page.selectOption('#projector select', 'white');
          await page.click('#projector button:has-text("Project")');
          await eventually('the screen is not white', () => screen.seen().white > 0.99);
          await page.waitForFunction(() => document.querySelector('#projector').dataset.state === 'on');
          await page.selectOption('#projector select', 'pattern');
          await page.click('#projector button:has-text("Project")');
          await eventually('the screen shows no stripes', () => screen.seen().coloured > 0.9);
          await page.click('#projector button:has-text("Stop")');
          await eventually('the stripes stay', () => screen.seen().coloured < 0.1);
          let state;
          await eventually(() => `the projector is ${JSON.stringify(state)}`, async () => {
            state = await (await get(server, '/api/projector')).json();
            return state.state === 'off';
          });
          assert.deepEqual([state.stream, state.show], ['rig', 'pattern']);
          const again = await fetch(`${server.address}/api/projector`, {
            method: 'POST',
            headers: { 'content-type': 'application/json' },
            body: JSON.stringify({ action: 'stop' }),
          });
          assert.equal(again.status, 409);
          await page.context().close();
          const showWhite = async () => {
            await fetch(`${server.address}/api/projector`, {
              method: 'POST',
              headers: { 'content-type': 'application/json' },
              body: JSON.stringify({ action: 'start', stream: 'rig', show: 'white' }),
            });
            await eventually('the screen is not white', () => screen.seen().white > 0.99);
          };
          const children = () => {
            const tasks = `/proc/${server.process.pid}/task`;
            return readdirSync(tasks).flatMap((task) => readFileSync(`${tasks}/${task}/children`, 'utf8').split(' ').filter(Boolean));
          };
          await showWhite();
          const [hangs] = children();
          process.kill(Number(hangs), 'SIGSTOP'); // as a display that hangs has it
          await showWhite();
          await eventually('one that hangs stays beside the next', () => !existsSync(`/proc/${hangs}`));
          // A server that is killed leaves no projector on.
        },
        screen.environment,
      );
      await eventually('the projector outlives its server', () => screen.seen().white < 0.5);
    } finally {
      await screen.close();
    }
  },

  async 'a projector that cannot be had says why'() {
    await withServer(
      [...scene(`plane,${kScene}`), '--projector', 'HDMI-77'],
      async (server) => {
        const page = await open(`${server.address}/rig`);
        await live(page);
        await page.click('#projector button:has-text("Project")');
        await page.waitForFunction(() => document.querySelector('#projector').dataset.state === 'failed');
        assert.match(await page.textContent('#projector-message'), /display|screen|X server/i);
        await page.context().close();
      },
      { DISPLAY: ':77', XDG_RUNTIME_DIR: '/nowhere', WAYLAND_DISPLAY: '' },
    );
  },

  async 'it is for phones, keyboards and both themes'() {
    await withServer(scene(`face,${kScene}`), async (server) => {
      for (const colorScheme of ['dark', 'light']) {
        const page = await open(`${server.address}/rig`, { viewport: { width: 390, height: 844 }, colorScheme });
        await live(page);
        const { wide, background } = await page.evaluate(() => ({
          wide: document.documentElement.scrollWidth - window.innerWidth,
          background: getComputedStyle(document.body).backgroundColor.match(/\d+/g).map(Number)[0],
        }));
        assert.ok(wide <= 0, `${wide} px beside the screen`);
        assert.equal(background > 128, colorScheme === 'light');
        await page.focus('#pictures button:nth-child(4)');
        await page.keyboard.press('Enter');
        await page.waitForFunction(() => document.querySelector('#picture').dataset.shows === 'coverage');
        assert.equal(await page.getAttribute('#pictures button:nth-child(4)', 'aria-pressed'), 'true');
        assert.match(page.url(), /#coverage$/);
        await page.context().close();
      }
      if (screenshots) await shots(server.address, 'face');
    });
  },
};

async function shots(address, name) {
  for (const colorScheme of ['dark', 'light']) {
    for (const [size, viewport] of [
      ['desktop', { width: 1280, height: 800 }],
      ['phone', { width: 390, height: 844 }],
    ]) {
      const page = await open(`${address}/rig#coverage`, { viewport, colorScheme });
      await page.waitForFunction(() => document.querySelector('#picture').dataset.shows === 'coverage');
      await page.screenshot({ path: join(screenshots, `rig-${name}-${size}-${colorScheme}.png`), fullPage: size === 'phone' });
      await page.context().close();
    }
  }
}

try {
  for (const [name, check] of Object.entries(checks)) {
    console.log(name);
    await check();
    assert.deepEqual(complaints, [], name);
  }
} finally {
  await browser.close();
}
