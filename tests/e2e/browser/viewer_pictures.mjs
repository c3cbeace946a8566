// SPDX-License-Identifier: Apache-2.0
// Takes the pictures of docs/viewer.md that no test takes. To be looked at: they prove nothing.
// Run as: in_own_domain node viewer_pictures.mjs RELIEVO_SERVER FOLDER [NAME...], in web/viewer; names: of these alone. Exit 77: no Chromium here.
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { kPatienceMs, launchChromium } from './chromium.mjs';
import { inState, shownPast, still } from './feeder.mjs';
import { recordObject } from './recorded.mjs';
import { Server } from './server.mjs';
import { makeSheet } from './sheet.mjs';

const [serverPath, folder, ...wanted] = process.argv.slice(2);
const kRate = 8; // what a processor that draws can follow
const kFrames = 60; // until the time line has something to show
const [kDesktop, kWide, kPhone] = [{ width: 1100, height: 680 }, { width: 1280, height: 800 }, { width: 390, height: 780 }];

const scratch = mkdtempSync(join(tmpdir(), 'relievo-pictures-'));
const config = join(scratch, 'server.toml');
const streams = ['face', 'object'].map((scene) => `[[stream]]\nname = "${scene}"\nsource = "sim:${scene},rate=${kRate}"\n`);
writeFileSync(config, streams.join('\n'));
recordObject(serverPath, join(scratch, 'object.mcap'), { rate: kRate, frames: 40 });
const browser = await launchChromium();
const server = await Server.start(serverPath, ['--config', config, '--record-dir', scratch, '--pre-roll', '2s']);

async function picture(name, path, { viewport = kDesktop, colorScheme = 'dark', hasTouch = false } = {}, act = async () => {}) {
  if (wanted.length > 0 && !wanted.includes(name)) return;
  const context = await browser.newContext({ viewport, colorScheme, hasTouch });
  const page = await context.newPage();
  page.setDefaultTimeout(kPatienceMs);
  await page.goto(server.address + path);
  await shownPast(page, 3);
  await act(page);
  await page.screenshot({ path: join(folder, name === '' ? 'viewer.png' : `viewer-${name}.png`) });
  await context.close();
  console.log(name);
}

const kModes = ['textured', 'shaded', 'wire', 'points', 'normals', 'depth', 'confidence']; // keys 1 to 7

/** Each mode, in each look, on a sheet a look. */
async function modes() {
  if (wanted.length > 0 && !wanted.includes('modes')) return;
  for (const [size, viewport] of [['desktop', kDesktop], ['phone', kPhone]]) {
    for (const colorScheme of ['dark', 'light']) {
      const context = await browser.newContext({ viewport, colorScheme, hasTouch: size === 'phone' });
      const page = await context.newPage();
      page.setDefaultTimeout(kPatienceMs);
      await page.goto(`${server.address}/?stream=object`);
      await shownPast(page, 3);
      await page.keyboard.press(' ');
      await still(page);
      const shots = [];
      for (const [i, name] of kModes.entries()) {
        await page.keyboard.press(String(i + 1));
        await still(page);
        shots.push({ name, png: (await page.screenshot()).toString('base64') });
      }
      const look = `${size}-${colorScheme}`;
      await makeSheet((options) => browser.newPage(options), join(folder, `viewer-modes-${look}.jpg`), look, shots);
      await context.close();
      console.log(`modes, ${look}`);
    }
  }
}

const presses = (...keys) => async (page) => {
  for (const key of keys) await page.keyboard.press(key);
  await page.waitForTimeout(1500); // for the look of it
};

/** Of the simulator's cube (capture/source/sim/scenes_simple.cpp): metres from its middle, in its own frame. */
function onCube([x, y, z]) {
  const [s, c] = [Math.sin(0.5), Math.cos(0.5)];
  return [0.12 + c * x + s * z, 0.078 + y, 0.95 - s * x + c * z];
}
async function measure(page, tool, places) {
  await page.click(`#panel-measure .segments button:text-is("${tool}")`);
  for (const place of places) {
    const at = await page.evaluate((point) => window.relievo.toPage(point), onCube(place));
    await page.mouse.click(at.x, at.y);
  }
}

try {
  await picture('', '/?stream=object', {}, async (page) => {
    await shownPast(page, kFrames / 2);
    await page.keyboard.press(' ');
    await still(page);
  });
  await picture('confidence', '/?stream=object', {}, async (page) => {
    await page.keyboard.press('7');
    await page.keyboard.press(' ');
    await still(page);
  });
  await picture('measure', '/?stream=object', {}, async (page) => {
    await page.keyboard.press('m');
    await page.keyboard.press(' ');
    await still(page);
    const [left, right] = [[-0.03, 0.02, -0.05], [0.05, 0.02, 0.02]]; // on either face
    await measure(page, 'Distance', [[-0.02, -0.03, -0.05], [-0.02, 0.03, -0.05]]);
    await measure(page, 'Section', [left, right]);
    await page.mouse.move(0, 0);
    await page.waitForTimeout(1000);
  });
  await picture('snap', '/?stream=object', {}, async (page) => {
    await page.keyboard.press('m');
    await shownPast(page, 10);
    await page.keyboard.press(' ');
    await still(page);
    const middle = await page.evaluate((point) => window.relievo.toPage(point), onCube([0.01, 0, -0.05]));
    await page.mouse.dblclick(middle.x, middle.y); // turns around the cube from now on
    await page.click('#panel-measure button:text-is("Clear")');
    await page.focus('#view');
    for (let i = 0; i < 9; ++i) await page.keyboard.press('+');
    await still(page);
    const corners = [[-0.05, -0.05, -0.05], [0.05, -0.05, -0.05], [0.05, 0.05, -0.05], [-0.05, 0.05, -0.05]];
    for (const i of [0, 1, 2]) await measure(page, 'Distance', [corners[i], corners[i + 1]]);
    await page.focus('#view');
    const over = await page.evaluate((point) => window.relievo.toPage(point), onCube(corners[3]));
    await page.mouse.move(over.x + 4, over.y - 4);
    await page.waitForTimeout(2000);
  });
  await picture('camera', '/?stream=object', {}, presses('c', 'v'));
  await picture('split', '/?stream=face', { viewport: kWide }, presses('v', 'v', 'v'));
  await picture('streams', '/?stream=face,object', { viewport: kWide }, async (page) => {
    await page.waitForFunction(() => window.relievo.diagnostics().besides[0].shown > 3);
    await presses('n')(page);
    await page.waitForFunction(() => document.querySelectorAll('.streams canvas[data-drawn]').length >= 2);
    await presses('r')(page);
  });
  await picture('statistics', '/?stream=object', {}, async (page) => {
    await page.keyboard.press('i');
    await shownPast(page, kFrames);
  });
  await picture('timeshift', '/?stream=face', { viewport: kWide }, async (page) => {
    await page.keyboard.press('x');
    await shownPast(page, kFrames);
    await page.keyboard.press(' ');
    for (let i = 0; i < 12; ++i) await page.keyboard.press(',');
    await inState(page, 'shifted');
    await still(page);
    await page.waitForTimeout(3000);
    await page.keyboard.press('x');
  });
  await picture('recording', '/?recording=object.mcap', { colorScheme: 'light' }, async (page) => {
    await page.keyboard.press(' ');
    await still(page);
  });
  await modes();
  await picture('phone', '/?stream=face', { viewport: kPhone, hasTouch: true });
  await picture('phone-light', '/?stream=object', { viewport: kPhone, colorScheme: 'light', hasTouch: true }, presses('m'));
} finally {
  await browser.close();
  await server.kill();
  rmSync(scratch, { recursive: true });
}
