// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium with an emulated headset (iwer): the button is there where a headset is; through it the
// surface stands where it was measured, in metres, from wherever the head is; leaving brings the page back.
// Run as: node immersive_test.mjs GATEWAY_FEEDER [SCREENSHOT], in web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import { eventually, launchChromium } from './chromium.mjs';
import { Feeder, inState, look, pagesOf, pointOf, runChecks, shownPast } from './feeder.mjs';

const [feederPath, screenshot] = process.argv.slice(2);
const kSide = 800; // pixels of the page, square
const kStart = [0, 1.6, 0]; // of the head in its room, metres: where iwer has it when a session begins
const kNear = 4; // pixels: 1.2 cm at the surface's distance

const feeder = await Feeder.start(feederPath);
const browser = await launchChromium();
const complaints = [];
const { newPage, open } = pagesOf(browser, `http://127.0.0.1:${feeder.port}`, complaints);

/** A page whose browser has a headset. */
async function openWithHeadset() {
  const page = await newPage({ viewport: { width: kSide, height: kSide } });
  page.on('pageerror', (error) => complaints.push(error.message));
  await page.addInitScript({ path: join(process.cwd(), 'node_modules/iwer/build/iwer.min.js') });
  await page.addInitScript((start) => {
    window.headset = new window.IWER.XRDevice(window.IWER.metaQuest3);
    window.headset.installRuntime({ forceInstall: true }); // Chromium has a runtime, and no headset
    window.headset.ipd = 0; // both eyes in the middle
    window.headset.position.set(...start);
    const { xr } = navigator;
    const request = xr.requestSession.bind(xr);
    xr.requestSession = async (...of) => (window.session = await request(...of));
  }, kStart);
  await page.goto(`http://127.0.0.1:${feeder.port}/#smooth=0`); // corners are looked at: nothing of the surface is left out
  return page;
}

/** What the headset shows of its next drawing but one from this pose: a grid of what the surface covers, and which frame it is. */
async function seen(page, { at, yaw }) {
  return page.evaluate(
    async ([position, angle]) => {
      window.headset.position.set(...position);
      window.headset.quaternion.set(0, Math.sin(angle / 2), 0, Math.cos(angle / 2));
      const next = () => new Promise((resolve) => window.session.requestAnimationFrame(resolve));
      await next();
      await next();
      return new Promise((resolve) => {
        window.session.requestAnimationFrame(() => {
          // Behind the page's own drawing, in the same task: what was drawn is still there.
          const gl = document.querySelector('#headset').getContext('webgl2');
          const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
          const rgba = new Uint8Array(4 * width * height);
          gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, rgba);
          let covered = '';
          for (let y = 0; y < height; ++y)
            for (let x = 0; x < width; ++x) covered += rgba[4 * ((height - 1 - y) * width + x) + 3] > 128 ? '1' : '0';
          resolve({ width, height, covered, frame: window.relievo.diagnostics().frame, fovy: window.headset.fovy });
        });
      });
    },
    [at, yaw],
  );
}

/** Where a point of the rig camera's frame must be seen, pixels from the upper left. */
function pixelOf(point, { at, yaw }, { width, height, fovy }) {
  // The origin is the head's first place; WebXR counts y upwards and z backwards.
  const [x, y, z] = [point[0] - (at[0] - kStart[0]), -point[1] - (at[1] - kStart[1]), -point[2] - (at[2] - kStart[2])];
  const turned = [Math.cos(yaw) * x - Math.sin(yaw) * z, y, Math.sin(yaw) * x + Math.cos(yaw) * z];
  const focal = height / 2 / Math.tan(fovy / 2);
  return [width / 2 - (focal * turned[0]) / turned[2], height / 2 + (focal * turned[1]) / turned[2]];
}

const checks = {
  async 'without a headset there is no button'() {
    const page = await open();
    await inState(page, 'live');
    await shownPast(page, 2);
    assert.equal(await page.evaluate(() => document.querySelector('#immersive')?.hidden ?? true), true);
    await page.close();
  },

  async 'the button enters, and the surface stands where it was measured'(page) {
    await inState(page, 'live');
    await shownPast(page, 1);
    await page.keyboard.press('2'); // shaded: all of it is opaque
    await page.keyboard.press('g');
    await page.waitForFunction(() => window.relievo.diagnostics().mode === 'shaded');
    await page.click('#immersive');
    await page.waitForFunction(
      () => window.session !== undefined && document.querySelector('#immersive')?.textContent === 'Leave',
    );
    for (const [right, up, back, yaw] of [
      [0, 0, 0, 0],
      [0.3, 0, 0, 0],
      [0, 0, 0.6, 0],
      [-0.2, 0.15, 0.3, -0.2],
    ]) {
      const pose = { at: [kStart[0] + right, kStart[1] + up, kStart[2] + back], yaw };
      const picture = await seen(page, pose);
      const centre = pixelOf(pointOf(0.5, 0.9, picture.frame), pose, picture);
      for (const [u, v] of [
        [0, 0],
        [1, 0],
        [0, 1],
        [1, 1],
      ]) {
        const corner = pixelOf(pointOf(u, v, picture.frame), pose, picture);
        const covers = (away) => {
          const length = Math.hypot(centre[0] - corner[0], centre[1] - corner[1]);
          const [x, y] = corner.map((c, i) => Math.round(c + ((corner[i] - centre[i]) / length) * away));
          return x >= 0 && y >= 0 && x < picture.width && y < picture.height && picture.covered[y * picture.width + x] === '1';
        };
        const where = `corner ${u}, ${v} at ${corner.map(Math.round)} of ${picture.width}x${picture.height} from ${JSON.stringify(pose)}`;
        assert.ok(covers(-2 * kNear), `${where}: not there`);
        assert.ok(!covers(kNear), `${where}: too large`);
      }
    }
  },

  async 'the stream goes on in it'(page) {
    const { shown } = await look(page).catch(() => ({ shown: 0 }));
    await shownPast(page, shown + 3);
    assert.equal(await page.evaluate(() => window.relievo.diagnostics().errors), 0);
    if (screenshot) await page.screenshot({ path: screenshot });
  },

  async 'leaving brings the page back'(page) {
    const pose = await page.evaluate(() => window.relievo.pose());
    await page.evaluate(() => window.session.end());
    await page.waitForFunction(() => document.querySelector('#immersive')?.textContent === 'Headset');
    const before = await look(page);
    await page.waitForFunction((n) => window.relievo.diagnostics().drawn > n, before.drawn);
    await eventually('nothing is drawn', async () => (await look(page)).pixels.covered > 0.1);
    assert.deepEqual(await page.evaluate(() => window.relievo.pose()), pose);
    assert.equal(before.errors, 0);
  },

  async 'no error, no request to another host'() {
    assert.deepEqual(complaints, []);
  },
};

let failed = 1;
try {
  feeder.say('start ball');
  failed = await runChecks(checks, await openWithHeadset());
} finally {
  await browser.close();
  await feeder.kill();
}
process.exit(failed === 0 ? 0 : 1);
