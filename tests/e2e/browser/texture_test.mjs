// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium: the texture's own pixels arrive with every codec, H.264 goes on after damage, and a
// browser without WebCodecs (plain http) shows the surface and says what is missing where there is nothing else, and the same
// picture in JPEG where the server makes it. Run as: in_own_domain node texture_test.mjs GATEWAY_FEEDER RELIEVO_SERVER RELIEVO, in web/viewer.
// Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { createInterface } from 'node:readline';
import { eventually, kPatienceMs, launchChromium } from './chromium.mjs';
import { inState, loaded } from './feeder.mjs';
import { recordObject } from './recorded.mjs';
import { Server } from './server.mjs';
import { startWeb } from './web.mjs';

const feeder = spawn(process.argv[2], ['0', '8'], { stdio: ['pipe', 'pipe', 'inherit'] });
const say = (line) => feeder.stdin.write(`${line}\n`);
const port = await new Promise((resolve, reject) => {
  createInterface({ input: feeder.stdout }).once('line', (line) => resolve(Number(line.split(' ')[1])));
  feeder.once('exit', () => reject(new Error('the feeder did not start')));
});

/** Pixels of the page that are the red and the green of the texture's corners, and those that have a colour at all. */
async function corners(page) {
  const png = (await page.screenshot()).toString('base64');
  return page.evaluate(async (data) => {
    const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes]));
    const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d');
    context.drawImage(bitmap, 0, 0);
    const { data: rgba } = context.getImageData(0, 0, bitmap.width, bitmap.height);
    let [red, green, coloured] = [0, 0, 0];
    for (let i = 0; i < rgba.length; i += 4) {
      const [r, g, b] = rgba.subarray(i, i + 3);
      if (Math.abs(r - 230) < 16 && Math.abs(g - 20) < 16 && Math.abs(b - 20) < 16) ++red;
      if (Math.abs(r - 20) < 16 && Math.abs(g - 200) < 16 && Math.abs(b - 20) < 16) ++green;
      if (Math.max(r, g, b) - Math.min(r, g, b) > 30) ++coloured;
    }
    return { red, green, coloured };
  }, png);
}
async function open(browser, address = `http://127.0.0.1:${port}/?stream=ball`, script = '') {
  const page = await browser.newPage({ viewport: { width: 800, height: 500 } });
  page.setDefaultTimeout(kPatienceMs);
  await page.addInitScript(script);
  await page.goto(address);
  await loaded(page);
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

/** Of a page whose browser decodes no H.264 for want of https: why, how to mend it, and meanwhile the relief. */
async function saysWhy(page) {
  assert.equal(await page.evaluate(() => typeof VideoDecoder), 'undefined');
  await page.waitForFunction(() => /H\.264.*https.*localhost.*relievo convert --texture jpeg/.test(document.querySelector('#notice')?.textContent));
  let seen;
  await eventually(() => `no surface, or no relief: ${JSON.stringify(seen)}`, async () => {
    seen = await page.evaluate(() => window.relievo.readPixels());
    return seen.covered > 0.15 && seen.deviation > 5;
  });
  assert.equal((await look(page)).errors, 0, (await look(page)).lastError);
}

/** What the statistics panel says of the codecs. */
async function codecs(page) {
  await page.keyboard.press('i');
  await page.waitForSelector('dt:text-is("codecs")');
  await eventually('no codecs are told', async () => (await codecsNow(page)) !== '–');
  const said = await codecsNow(page);
  await page.keyboard.press('i');
  return said;
}
const codecsNow = (page) => page.textContent('dt:text-is("codecs") + dd');

let server;
let web;
const scratch = mkdtempSync(join(tmpdir(), 'relievo-texture-'));
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
  // One may be dropped on the way, like any frame this page is too slow for.
  await eventually('the damaged frame is not counted', async () => {
    say('corrupt');
    await page.waitForTimeout(500);
    return (await look(page)).errors > 0;
  });
  await more(page, 12);
  await showsTexture(page, 'after damage');
  console.log('ok: after damage');
  await browser.close();

  // An address of another machine, as far as the browser knows: plain http there is no secure context.
  browser = await launchChromium(['--host-resolver-rules=MAP 192.0.2.1 127.0.0.1']);
  const plain = await open(browser, `http://192.0.2.1:${port}/?stream=ball`);
  await more(plain, 3);
  await saysWhy(plain);
  await plain.close();
  console.log('ok: without WebCodecs');

  const recorded = recordObject(process.argv[3], join(scratch, 'video.mcap'), { rate: 6, frames: 5, options: ['--texture', 'h264'] });
  web = await startWeb(process.argv[4], recorded);
  for (const secure of [true, false]) {
    const page = await open(browser, secure ? web.address : web.address.replace('127.0.0.1', '192.0.2.1'));
    await inState(page, 'file');
    await page.waitForFunction(() => window.relievo.diagnostics().shown > 0); // it may have ended by now
    if (!secure) await saysWhy(page);
    else await eventually('a recording\'s H.264 is not decoded', async () => (await page.isHidden('#notice')) && (await corners(page)).coloured > 500);
    await page.close();
  }
  console.log('ok: a recording without WebCodecs');

  // From a server that makes JPEG for such a page, beside one that decodes video.
  server = await Server.start(process.argv[3], ['--source', 'sim:face', '--texture', 'h264', '--stream', 'ball']);
  const address = `${server.address}/?stream=ball`;
  const video = await open(browser, address);
  await more(video, 3);
  const hidden = await open(browser, address, 'delete window.VideoDecoder;');
  await more(hidden, 3);
  await eventually('no JPEG comes to the page without WebCodecs', async () => /JPEG/.test(await codecs(hidden)));
  assert.match(await codecs(hidden), /no H\.264 here/);
  assert.match(await codecs(video), /H\.264/);
  assert.doesNotMatch(await codecs(video), /JPEG|here/);
  // A page without a processor to itself may still be on its way to its view.
  let there, here;
  const counted = () => `not the same picture: ${there.coloured} coloured pixels of H.264, ${here.coloured} of JPEG`;
  await eventually(counted, async () => {
    [there, here] = [await corners(video), await corners(hidden)];
    return here.coloured > 5000 && Math.abs(here.coloured / there.coloured - 1) < 0.15;
  });
  console.log(`coloured pixels: ${there.coloured} of H.264, ${here.coloured} of JPEG`);
  for (const [name, page] of Object.entries({ video, hidden })) {
    assert.ok(await page.isHidden('#notice'), name);
    const { errors, lastError } = await look(page);
    const drops = async () => (await (await fetch(`${server.address}/metrics`)).text()).match(/^relievo_stream_drops_total.*/gm);
    assert.equal(errors, 0, errors > 0 ? `${name}: ${lastError}; ${await drops()}` : '');
  }
  console.log('ok: JPEG where WebCodecs are missing');
} finally {
  await server?.kill();
  await web?.stop();
  rmSync(scratch, { recursive: true });
  await browser.close();
  feeder.kill('SIGKILL');
}
