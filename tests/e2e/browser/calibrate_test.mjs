// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium against `relievo-server serve` that owns a camera (simulated) and a projector
// (an X server without a screen): a rig is calibrated on the page /rig from nothing, and reconstructs as its
// truth does; the rig file before stays; what is not good is said, and why; the stream goes on however a
// calibration ends. Run as: in_own_domain node calibrate_test.mjs RELIEVO_SERVER [SCREENSHOTS], in web/viewer.
// Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { copyFileSync, existsSync, mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';

import { eventually, kLongPatienceMs, kPatienceMs, launchChromium } from './chromium.mjs';
import { Screen } from './screen.mjs';
import { Server } from './server.mjs';

const [serverPath, screenshots] = process.argv.slice(2);
const kScene = 'width=320,height=240,scan=progressive,stripes=40,distortion=1';
const kSource = `sim:object,${kScene},rate=10`;
const kChessboard = 'chessboard:7x5:40mm';
const kCharuco = 'charuco:7x5:40mm:30mm:4X4_50';

const browser = await launchChromium();
const complaints = [];
const kExpected = /status of (404|409|503)/; // the stream is away; an order is refused, as it should be
async function open(address, options = {}) {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, ...options });
  const page = await context.newPage();
  page.setDefaultTimeout(kPatienceMs);
  page.on('pageerror', (error) => complaints.push(error.message));
  page.on('console', (message) => {
    if (message.type() === 'error' && !kExpected.test(message.text())) complaints.push(message.text());
  });
  await page.goto(`${address}/rig`);
  return page;
}

const state = async (server) => (await fetch(`${server.address}/api/calibration`)).json();
const streams = async (server, name = 'rig') =>
  (await (await fetch(`${server.address}/api/streams`)).json()).streams.filter((stream) => stream.name === name);
const order = (server, body, headers = {}) =>
  fetch(`${server.address}/api/calibration`, {
    method: 'POST',
    headers: { 'content-type': 'application/json', ...headers },
    body: JSON.stringify(body),
  });
const press = (page, action) => page.click(`#calibration [data-action=${action}]:enabled`);
const kLong = { timeout: kLongPatienceMs }; // it detects, calculates and scores
const reaches = (page, phase) =>
  page.waitForFunction((wanted) => document.querySelector('#calibration').dataset.state === wanted, phase, kLong);
/** The action of the button that has the keyboard, or the element's id. */
const held = (page) => page.evaluate(() => document.activeElement.dataset.action ?? document.activeElement.id);
const goesOn = (server, name) =>
  eventually('the stream does not go on', async () => (await streams(server, name))[0]?.frames > 0);
const shot = async (page, name) => {
  if (screenshots) await page.screenshot({ path: join(screenshots, `calibrate-${name}.png`) });
};

async function choose(page, kind) {
  await page.waitForSelector('#calibration:not([hidden])');
  await page.selectOption('#calibration select', kind);
  if (kind === 'geometry') await page.fill('#calibration-board', kChessboard);
  await page.click('#calibration button:has-text("Start")');
  await reaches(page, 'watching');
}

/** Over its picture, with the way to the page of the rig; null: nothing. */
async function viewerSays(server, words) {
  const page = await open(server.address);
  await page.goto(`${server.address}/?stream=rig`);
  await page.waitForSelector('body[data-state=live]', kLong);
  if (words === null) await page.waitForSelector('#notice', { state: 'hidden' });
  else {
    await page.waitForSelector('#notice:not([hidden])');
    assert.match(await page.textContent('#notice'), words);
    await shot(page, 'viewer');
    await page.click('#notice a');
    await page.waitForURL(/\/rig\?stream=rig/);
  }
  await page.context().close();
}

async function withRig(options, use, environment, stream = 'rig') {
  const folder = mkdtempSync(join(tmpdir(), 'relievo-calibrate-'));
  const rig = join(folder, 'rig.yaml');
  const server = await Server.start(serverPath, ['--stream', stream, '--rig', rig, ...options], environment);
  try {
    await use(server, folder, rig);
  } finally {
    await server.kill();
    rmSync(folder, { recursive: true, force: true });
  }
}

/** What `evaluate` says of a take of the simulated rig, reconstructed with this rig.yaml instead of the truth. */
function evaluated(folder, rig) {
  const take = join(folder, 'take');
  execFileSync(serverPath, ['simulate', '--scene', `object,${kScene}`, '--frames', '3', '--out', take], { stdio: 'ignore' });
  const truth = JSON.parse(execFileSync(serverPath, ['evaluate', take, '--json'], { stdio: ['ignore', 'pipe', 'ignore'] }));
  copyFileSync(rig, join(take, 'rig.yaml'));
  const own = JSON.parse(execFileSync(serverPath, ['evaluate', take, '--json'], { stdio: ['ignore', 'pipe', 'ignore'] }));
  return { truth, own };
}

/** Most of it is waiting: it runs beside the checks. */
async function leaves() {
  await withRig(
    ['--source', kSource],
    async (server, folder) => {
      const page = await open(server.address);
      await choose(page, 'geometry');
      assert.equal((await order(server, { action: 'calculate' })).status, 409, 'without a view');
      assert.deepEqual(await streams(server, 'left'), []);
      await page.context().close();
      await goesOn(server, 'left');
      const left = await state(server);
      assert.match(left.message, /no page watched/);
      assert.equal(left.failed, true);
      assert.deepEqual(readdirSync(folder), []);
    },
    {},
    'left',
  );
}

const checks = {
  async 'a rig is calibrated from nothing, and reconstructs'() {
    const screen = await Screen.start(1024, 768); // as the simulated rig's projector
    try {
      await withRig(
        ['--source', kSource, '--projector', 'auto'],
        async (server, folder, rig) => {
          const page = await open(server.address);
          await eventually('it is not said that the rig is not calibrated', async () =>
            /not calibrated/.test((await streams(server))[0]?.status?.message ?? ''),
          );
          await page.waitForFunction(() => /not calibrated/.test(document.querySelector('#advice')?.textContent));
          assert.doesNotMatch(await page.textContent('#advice'), /focus/);
          await shot(page, 'guessed');
          await viewerSays(server, /not calibrated/);
          await choose(page, 'colour');
          assert.match(await page.textContent('#calibration-next'), /white sheet/);
          await page.waitForSelector('#pictures', { state: 'hidden' }); // what the stream shows is paused
          await eventually('the projector shows no colours', () => screen.seen().coloured > 0.9 || screen.seen().white > 0.9);
          await shot(page, 'colour');
          await press(page, 'take');
          await reaches(page, 'solved');
          assert.match(await page.textContent('#calibration-result'), /good/);
          assert.ok(Number(await page.textContent('#calibration-result [data-figure=residual]')) < 5);
          assert.equal(existsSync(rig), false, 'written before it was to be kept');
          await shot(page, 'colour-result');
          await press(page, 'keep');
          await reaches(page, 'off');
          await goesOn(server);
          assert.match(readFileSync(rig, 'utf8'), /colour_matrix/);

          await choose(page, 'geometry');
          assert.equal(await page.isDisabled('#calibration [data-action=calculate]'), true);
          await press(page, 'take');
          await page.waitForSelector('#calibration-views [data-used=true]', kLong);
          assert.match(await page.textContent('#calibration-views li'), /35 corners/);
          await page.waitForFunction(() => /hold the board/.test(document.querySelector('#calibration-next')?.textContent));
          await eventually('the projector shows no stripes', () => screen.seen().coloured > 0.9);
          await shot(page, 'geometry');
          await page.check('#calibration input[type=checkbox]');
          await page.waitForFunction(() => document.querySelectorAll('#calibration-views [data-used=true]').length >= 8, null, kLong);
          await press(page, 'calculate');
          await reaches(page, 'solved');
          assert.ok(parseFloat(await page.textContent('#calibration-result [data-figure=stereo]')) < 0.3);
          assert.ok(Math.abs(parseFloat(await page.textContent('#calibration-result [data-figure=baseline]')) - 200) < 4);
          await shot(page, 'geometry-result');
          await press(page, 'keep');
          await reaches(page, 'off');
          assert.match(await page.textContent('#calibration-message'), /Written to rig\.yaml; the one before is rig\.before-/);
          await goesOn(server);
          await eventually('the stream does not know its new rig', async () => {
            const [{ status }] = await streams(server);
            return status?.message === '';
          });
          await eventually('the projector stays on', () => screen.seen().coloured < 0.1);
          await page.waitForFunction(() => document.body.dataset.state === 'live' && document.querySelector('#picture').dataset.shows === 'camera');
          await viewerSays(server, null);
          assert.doesNotMatch(await page.textContent('#advice'), /not calibrated/);
          const { truth, own } = evaluated(folder, rig);
          console.log(`  completeness ${own.completeness} (truth's rig: ${truth.completeness}), median ${own.median_um_per_m ?? ''}`);
          assert.ok(own.completeness > truth.completeness - 0.02, JSON.stringify(own));
          await page.context().close();
        },
        screen.environment,
      );
    } finally {
      await screen.close();
    }
  },

  async 'the rig before stays, and what a step does not touch'() {
    await withRig(['--source', kSource], async (server, folder, rig) => {
      const page = await open(server.address);
      for (const [round, action] of ['keep', 'more', 'keep'].entries()) {
        if (round !== 2) await choose(page, 'colour');
        await press(page, 'take');
        await reaches(page, 'solved');
        await press(page, action);
        await reaches(page, action === 'keep' ? 'off' : 'watching');
        assert.equal(await held(page), action === 'keep' ? 'calibration-message' : 'take');
        if (action === 'keep') assert.match(await page.textContent('#calibration-result h3'), /colours, kept/);
      }
      const old = readdirSync(folder).filter((name) => name.startsWith('rig.before-'));
      assert.equal(old.length, 1);
      assert.match(readFileSync(join(folder, old[0]), 'utf8'), /colour_matrix/);
      assert.ok(existsSync(rig) && existsSync(join(folder, 'pattern.yaml')));
      await page.context().close();
    });
  },

  async 'a picture that is asked for when a calibration ends is not missed'() {
    await withRig(['--source', kSource], async (server) => {
      const page = await open(server.address);
      await page.evaluate(() => {
        window.bad_ = [];
        const say = () => document.body.dataset.state === 'bad' && window.bad_.push(document.querySelector('#state').textContent);
        new MutationObserver(say).observe(document.body, { attributes: true });
      });
      await choose(page, 'colour');
      let late = 0;
      await new Promise((asked) => {
        page.route('**/api/calibration/camera.jpg', async (route) => {
          ++late;
          asked();
          await reaches(page, 'off'); // the server has none any more
          await route.continue();
        });
      });
      const answered = page.waitForResponse('**/api/calibration/camera.jpg');
      await press(page, 'cancel');
      assert.equal((await answered).status(), 503);
      await page.waitForFunction(() => document.body.dataset.state === 'live' && document.querySelector('#picture').dataset.shows === 'camera');
      assert.deepEqual(await page.evaluate(() => window.bad_), []);
      assert.equal(late, 1);
      await page.context().close();
    });
  },

  async 'a server that goes away in the middle is missed, and one that was started again has lost it'() {
    await withRig(['--source', kSource], async (server, _, rig) => {
      const page = await open(server.address);
      await choose(page, 'colour');
      await page.reload();
      await reaches(page, 'watching');
      await page.waitForFunction(() => document.querySelector('#stream').value === 'rig');
      await press(page, 'take');
      await reaches(page, 'solved');
      assert.equal(await held(page), 'keep');
      await server.kill();
      await page.waitForSelector('#calibration[inert]');
      assert.match(await page.textContent('#calibration-message'), /does not answer/);
      await page.waitForFunction(() => document.body.dataset.state === 'bad');
      await shot(page, 'away');
      const { asked, seconds } = await page.evaluate(async () => {
        performance.clearResourceTimings();
        const begin = performance.now();
        await new Promise((resolve) => setTimeout(resolve, 3000));
        return { asked: performance.getEntriesByType('resource').length, seconds: (performance.now() - begin) / 1000 };
      });
      assert.ok(asked <= (8 / 3) * seconds, `asked ${asked} times in ${seconds} s`); // of the calibration, the projector and for streams
      complaints.length = 0; // of the server that is not there
      const again = await Server.run(serverPath, ['serve', '--stream', 'rig', '--rig', rig, '--source', kSource, '--web', new URL(server.address).host]);
      try {
        await reaches(page, 'off');
        assert.match(await page.textContent('#calibration-message'), /was restarted: the calibration was lost/);
        await page.waitForFunction(() => {
          const { top } = document.querySelector('#calibration-message').getBoundingClientRect();
          return top > 0 && top < 780 && !document.querySelector('#calibration').inert; // in sight
        });
        await page.waitForFunction(() => document.body.dataset.state === 'live');
        assert.match(await page.textContent('#calibration-message'), /was restarted/, 'said for a moment alone');
        await shot(page, 'restarted');
        await choose(page, 'colour');
        assert.equal(await page.isVisible('#calibration-message'), false);
        complaints.length = 0;
        await page.context().close();
      } finally {
        await again.kill();
      }
    });
  },

  async 'what is not good is said, and what to do'() {
    await withRig(['--source', `${kSource},exposure=4`], async (server, folder) => {
      const page = await open(server.address);
      await choose(page, 'colour');
      await press(page, 'take');
      await page.waitForSelector('#calibration-views [data-used=false]', kLong);
      assert.match(await page.textContent('#calibration-views li'), /exposure/);
      await shot(page, 'not-used');
      assert.equal((await order(server, { action: 'start', stream: 'rig', kind: 'colour' })).status, 409, 'a second one');
      await press(page, 'cancel');
      await reaches(page, 'off');
      assert.match(await page.textContent('#calibration-message'), /as it was/);
      await goesOn(server);

      await page.selectOption('#calibration select', 'geometry');
      for (const [board, says] of [
        ['a plank', /^'a plank' is no board such as chessboard/],
        ['', /^'' is no board such as chessboard/],
        ['chessboard:9x7:900mm', /^Chessboard:9x7:900mm does not fit before the rig: give a smaller board\.$/],
      ]) {
        await page.fill('#calibration-board', board);
        await page.click('#calibration button:has-text("Start")');
        await page.waitForFunction((wanted) => new RegExp(wanted).test(document.querySelector('#calibration-message.bad')?.textContent), says.source);
        await reaches(page, 'off');
      }
      assert.equal((await state(server)).state, 'off');
      assert.deepEqual(readdirSync(folder), []);
      await page.context().close();
    });
  },

  async 'who leaves the page leaves the stream'() {
    await leaving;
  },

  async 'it is refused to those who may not, and where it cannot be'() {
    const start = { action: 'start', stream: 'rig', kind: 'colour' };
    await withRig(['--source', kSource], async (server) => {
      assert.equal((await order(server, start, { 'content-type': 'text/plain' })).status, 415);
      assert.equal((await order(server, start, { origin: 'http://elsewhere.example' })).status, 403);
      assert.equal((await order(server, { action: 'start', stream: 'rig' })).status, 400);
      assert.equal((await order(server, { action: 'take' })).status, 409);
      assert.equal((await order(server, { ...start, stream: 'other' })).status, 409);
      assert.equal((await fetch(`${server.address}/api/calibration/sound.jpg`)).status, 400);
      assert.equal((await fetch(`${server.address}/api/calibration/camera.jpg`)).status, 503);
    });
    for (const [options, says] of [
      [[], /--rig FILE/],
      [['--rig', '/nowhere/of/ours/rig.yaml'], /make the folder \/nowhere\/of\/ours/],
    ]) {
      const server = await Server.start(serverPath, ['--source', kSource, '--stream', 'rig', ...options]);
      try {
        const refused = await order(server, start);
        assert.equal(refused.status, 409);
        assert.match(await refused.text(), says);
      } finally {
        await server.kill();
      }
    }
  },

  async 'a projector that is switched off ends it, and the stream goes on'() {
    const screen = await Screen.start(1024, 768);
    try {
      await withRig(
        ['--source', kSource, '--projector', 'auto'],
        async (server) => {
          const page = await open(server.address);
          await choose(page, 'colour');
          await fetch(`${server.address}/api/projector`, {
            method: 'POST',
            headers: { 'content-type': 'application/json' },
            body: JSON.stringify({ action: 'stop' }),
          });
          await reaches(page, 'off');
          assert.match(await page.textContent('#calibration-message'), /projector was switched off/);
          await goesOn(server);
          await page.context().close();
        },
        screen.environment,
      );
    } finally {
      await screen.close();
    }
  },

  async 'a rig is calibrated with a ChArUco board, which is chosen by name'() {
    // The camera goes on meanwhile: of four times the pixels a busy machine loses frames, and with them the board's rest.
    await withRig(['--source', `sim:object,${kScene.replace('320,height=240', '640,height=480')},rate=5`], async (server, folder, rig) => {
      const page = await open(server.address);
      await page.waitForSelector('#calibration:not([hidden])');
      await page.selectOption('#calibration select', 'geometry');
      await page.selectOption('#calibration .board select', 'charuco');
      assert.match(await page.inputValue('#calibration-board'), /^charuco:/);
      assert.match(await page.textContent('#calibration .board small'), /marker/);
      await page.fill('#calibration-board', kChessboard);
      assert.equal(await page.inputValue('#calibration .board select'), 'chessboard', 'what is typed says which it is');
      await page.fill('#calibration-board', kCharuco);
      await shot(page, 'charuco-choice');
      await page.click('#calibration button:has-text("Start")');
      await reaches(page, 'watching');
      assert.equal((await state(server)).board, kCharuco);
      await press(page, 'take');
      await page.waitForSelector('#calibration-views [data-used=true]', kLong);
      assert.match(await page.textContent('#calibration-views [data-used=true]'), /24 corners/);
      await shot(page, 'charuco');
      await page.check('#calibration input[type=checkbox]');
      for (let n = 2; n <= 6; ++n) {
        await page.waitForFunction((least) => document.querySelectorAll('#calibration-views [data-used=true]').length >= least, n, kLong);
      }
      await press(page, 'calculate');
      await reaches(page, 'solved');
      assert.ok(parseFloat(await page.textContent('#calibration-result [data-figure=stereo]')) < 0.3);
      assert.ok(Math.abs(parseFloat(await page.textContent('#calibration-result [data-figure=baseline]')) - 200) < 4);
      await shot(page, 'charuco-result');
      await press(page, 'keep');
      await reaches(page, 'off');
      assert.match(readFileSync(rig, 'utf8'), /stereo_rms_px/);
      await goesOn(server);
      await page.context().close();
    });
  },

  async 'a configuration that is read again disturbs no calibration, and holds after it'() {
    const folder = mkdtempSync(join(tmpdir(), 'relievo-calibrate-'));
    const [config, rig] = [join(folder, 'server.toml'), join(folder, 'rig.yaml')];
    const configure = (scene) =>
      writeFileSync(config, `[[stream]]\nname = "rig"\nsource = "sim:${scene},${kScene},rate=10"\n[stream.camera]\nrig = "${rig}"\n`);
    configure('object');
    const server = await Server.start(serverPath, ['--config', config]);
    const readAgain = async (times) => {
      server.process.kill('SIGHUP');
      await eventually('it is not read again', () => server.said.split('the configuration was read again').length > times);
    };
    try {
      const page = await open(server.address);
      await choose(page, 'colour');
      await readAgain(1);
      assert.equal((await state(server)).state, 'watching');
      configure('face');
      await readAgain(2);
      assert.equal((await state(server)).state, 'watching');
      await press(page, 'take');
      await reaches(page, 'solved');
      assert.deepEqual(await streams(server), [], 'the stream took its camera back from the calibration');
      await press(page, 'keep');
      await reaches(page, 'off');
      await goesOn(server);
      const [{ source, status }] = await streams(server);
      assert.match(source, /^sim:face/);
      assert.match(status.message, /not calibrated/); // its geometry, of which nothing is known yet
      assert.match(readFileSync(rig, 'utf8'), /colour_matrix/);
      await page.context().close();
    } finally {
      await server.kill();
      rmSync(folder, { recursive: true, force: true });
    }
  },

  async 'it is for phones and both themes'() {
    await withRig(['--source', kSource], async (server) => {
      for (const colorScheme of ['dark', 'light']) {
        const page = await open(server.address, { viewport: { width: 390, height: 844 }, colorScheme });
        await choose(page, 'geometry');
        await press(page, 'take');
        await page.waitForSelector('#calibration-views li', kLong);
        const wide = await page.evaluate(() => document.documentElement.scrollWidth - window.innerWidth);
        assert.ok(wide <= 0, `${wide} px beside the screen`);
        const { bottom } = await page.locator('#calibration [data-action=take]').evaluate((b) => b.getBoundingClientRect());
        assert.ok(bottom <= 844, 'the button is below the screen');
        await page.waitForSelector('#tilts [data-side=lower]', kLong);
        const small = await page.$$eval('#seen :is(span, figcaption, li)', (words) => words.map((w) => parseFloat(getComputedStyle(w).fontSize)).filter((px) => px < 12));
        assert.deepEqual(small, [], 'words that cannot be read');
        const { seen } = await page.evaluate(() => ({ seen: getComputedStyle(document.querySelector('#coverage')).filter }));
        assert.equal(seen !== 'none', colorScheme === 'light', 'the picture is dark on a light page');
        await shot(page, `phone-${colorScheme}`);
        await press(page, 'cancel');
        await reaches(page, 'off');
        await goesOn(server);
        await page.context().close();
      }
    });
  },
};

const leaving = leaves();
leaving.catch(() => undefined); // told by its check
try {
  for (const [name, check] of Object.entries(checks)) {
    console.log(name);
    await check();
    assert.deepEqual(complaints, [], name);
  }
} finally {
  await browser.close();
  await Server.killAll(); // where a check failed, that of leaves() too, which tidies up then
  await leaving.catch(() => undefined);
}
