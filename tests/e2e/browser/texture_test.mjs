// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium: the texture's own pixels arrive with every codec, H.264 goes on after damage, and a
// browser without WebCodecs (plain http) shows the surface and says what is missing. Run as: node texture_test.mjs GATEWAY_FEEDER, in
// web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { createInterface } from 'node:readline';
import { eventually, kPatienceMs, launchChromium } from './chromium.mjs';

const feeder = spawn(process.argv[2], ['0', '8'], { stdio: ['pipe', 'pipe', 'inherit'] });
const say = (line) => feeder.stdin.write(`${line}\n`);
const port = await new Promise((resolve, reject) => {
  createInterface({ input: feeder.stdout }).once('line', (line) => resolve(Number(line.split(' ')[1])));
  feeder.once('exit', () => reject(new Error('the feeder did not start')));
});

/** Pixels of the page that are the red and the green of the texture's corners. */
async function corners(page) {
  const png = (await page.screenshot()).toString('base64');
  return page.evaluate(async (data) => {
    const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes]));
    const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d');
    context.drawImage(bitmap, 0, 0);
    const { data: rgba } = context.getImageData(0, 0, bitmap.width, bitmap.height);
    let [red, green] = [0, 0];
    for (let i = 0; i < rgba.length; i += 4) {
      const [r, g, b] = rgba.subarray(i, i + 3);
      if (Math.abs(r - 230) < 16 && Math.abs(g - 20) < 16 && Math.abs(b - 20) < 16) ++red;
      if (Math.abs(r - 20) < 16 && Math.abs(g - 200) < 16 && Math.abs(b - 20) < 16) ++green;
    }
    return { red, green };
  }, png);
}
async function open(browser, host = '127.0.0.1') {
  const page = await browser.newPage({ viewport: { width: 800, height: 500 } });
  page.setDefaultTimeout(kPatienceMs);
  await page.goto(`http://${host}:${port}/?stream=ball`);
  return page;
}
const look = (page) => page.evaluate(() => window.relievo.diagnostics());
async function more(page, frames) {
  const least = (await look(page)).shown + frames;
  await page.waitForFunction((count) => window.relievo.diagnostics().shown >= count, least);
}
async function showsTexture(page, what) {
  let found;
  await eventually(
    () => `${what}: the texture's colours are not on the page: ${JSON.stringify(found)}`,
    async () => {
      found = await corners(page);
      return found.red > 300 && found.green > 300;
    },
  );
}

let browser = await launchChromium();
try {
  const page = await open(browser);
  say('start ball');
  for (const name of ['jpeg', 'webp', 'png', 'h264']) {
    say(`texture ${name}`);
    await more(page, 12); // past what was under way, and more than an interval of key frames
    const before = await look(page);
    await showsTexture(page, name);
    await more(page, 4);
    assert.equal((await look(page)).errors, before.errors, `${name}: ${(await look(page)).lastError}`);
    assert.ok(await page.isHidden('#notice'), name);
    console.log(`ok: ${name}`);
  }
  say('corrupt');
  await eventually('the damaged frame is not counted', async () => (await look(page)).errors > 0);
  await more(page, 12);
  await showsTexture(page, 'after damage');
  console.log('ok: after damage');
  await browser.close();

  // An address of another machine, as far as the browser knows: plain http there is no secure context.
  browser = await launchChromium(['--host-resolver-rules=MAP 192.0.2.1 127.0.0.1']);
  const plain = await open(browser, '192.0.2.1');
  await more(plain, 3);
  assert.equal(await plain.evaluate(() => typeof VideoDecoder), 'undefined');
  assert.match(await plain.textContent('#notice'), /https/);
  const pixels = await plain.evaluate(() => window.relievo.readPixels());
  assert.ok(pixels.covered > 0.2, `the surface covers ${pixels.covered} of the page`);
  assert.equal((await look(plain)).errors, 0, (await look(plain)).lastError);
  console.log('ok: without WebCodecs');
} finally {
  await browser.close();
  feeder.kill('SIGKILL');
}
