// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium: who has no token is asked for it by a page that looks like the viewer, light and dark, on
// a phone too; a wrong one is said to be wrong, without being shown or kept; a right one leads to what was asked for,
// and a browser that keeps no cookies is told of it. A recording
// whose token is not known any more goes on once somebody has signed in, in another tab.
// Run as: in_own_domain node sign_in_test.mjs RELIEVO_SERVER [FOLDER for screenshots], in web/viewer. Exit 77: no Chromium
// here.
import assert from 'node:assert/strict';
import { mkdirSync, mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { eventually, kPatienceMs, launchChromium } from './chromium.mjs';
import { inState, runChecks, shownPast } from './feeder.mjs';
import { recordObject } from './recorded.mjs';
import { Server } from './server.mjs';
import { seek } from './timeline.mjs';

const [serverPath, shots] = process.argv.slice(2);
const kToken = 'a-token-for-this-test';
const kWrong = 'a-token-that-is-none-here';

const scratch = mkdtempSync(join(tmpdir(), 'relievo-sign-in-'));
const tokens = join(scratch, 'tokens');
writeFileSync(tokens, `${kToken}\n`, { mode: 0o600 });
const folder = join(scratch, 'folder');
mkdirSync(folder);
// Above 16 MB, so that most of it is read where it is needed.
recordObject(serverPath, join(folder, 'long.mcap'), { rate: 6, frames: 36, size: 'width=640,height=480,stripes=60', options: ['--texture', 'png'] });
const server = await Server.start(serverPath, ['--source', 'sim:object,width=320,height=240,stripes=60,rate=5', '--stream', 'object', '--token-file', tokens, '--record-dir', folder]);
const browser = await launchChromium();
const page = await browser.newPage({ viewport: { width: 1000, height: 640 } });
page.setDefaultTimeout(kPatienceMs);
const complaints = [];
page.on('console', (message) => complaints.push(message.text()));

const kWays = {
  light: { colorScheme: 'light', width: 1000 },
  dark: { colorScheme: 'dark', width: 1000 },
  'light phone': { colorScheme: 'light', width: 360 },
  'dark phone': { colorScheme: 'dark', width: 360 },
};
const screenshot = (name) => shots && page.screenshot({ path: join(shots, `${name.replaceAll(' ', '-')}.png`) });

/** The contrast of an element's letters with what is behind them (WCAG 2). */
const contrastOf = (selector) =>
  page.evaluate((of) => {
    const rgb = (text) => text.match(/[\d.]+/g).map(Number);
    const luminance = (c) => [0.2126, 0.7152, 0.0722].reduce((sum, w, i) => sum + w * (c[i] / 255 <= 0.04045 ? c[i] / 255 / 12.92 : ((c[i] / 255 + 0.055) / 1.055) ** 2.4), 0);
    const element = document.querySelector(of);
    let behind = element;
    while (rgb(getComputedStyle(behind).backgroundColor)[3] === 0) behind = behind.parentElement;
    const [a, b] = [getComputedStyle(element).color, getComputedStyle(behind).backgroundColor].map((c) => luminance(rgb(c)));
    return (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
  }, selector);

const checks = {};
for (const [name, { colorScheme, width }] of Object.entries(kWays)) {
  checks[`${name}: it asks, and says that a wrong token is not known`] = async () => {
    await page.emulateMedia({ colorScheme });
    await page.setViewportSize({ width, height: 640 });
    await page.goto(server.address);
    const field = page.getByLabel('Token');
    const focused = () => page.waitForFunction(() => document.activeElement?.matches('input[name=token]')); // with its first drawing
    assert.equal(await page.locator('[role=alert]').count(), 0);
    await focused();
    await screenshot(name);
    await field.fill(kWrong);
    const [response] = await Promise.all([page.waitForNavigation(), page.keyboard.press('Enter')]);
    assert.equal(response.status(), 401);
    assert.match(await page.textContent('[role=alert]'), /^This token is not known/);
    assert.ok(!(await page.content()).includes(kWrong), 'what was typed is in the page');
    assert.deepEqual(await page.context().cookies(), []);
    await focused();
    assert.equal(await field.getAttribute('aria-invalid'), 'true');
    await screenshot(`${name} wrong`);
    for (const of of ['h1', 'main > p', '[role=alert]', 'label', 'input', 'button']) {
      const contrast = await contrastOf(of);
      assert.ok(contrast >= 4.5, `${of}: ${contrast.toFixed(2)}`);
    }
    const { field_px, page_px } = await page.evaluate(() => {
      const { width: across, height: high } = document.querySelector('input').getBoundingClientRect();
      return { field_px: [across, high], page_px: document.documentElement.scrollWidth };
    });
    assert.ok(page_px <= width, `the page is ${page_px} px wide`);
    assert.ok(field_px[0] > 200 && field_px[1] >= 36, `the field is ${field_px.join(' x ')} px`);
  };
}

checks['its ground is the viewer\'s'] = async () => {
  for (const [colorScheme, ground] of [['light', 'rgb(223, 228, 234)'], ['dark', 'rgb(12, 15, 19)']]) {
    await page.emulateMedia({ colorScheme });
    assert.equal(await page.evaluate(() => getComputedStyle(document.body).backgroundColor), ground);
  }
};

checks['a right one leads to what was asked for, in the view of the link'] = async () => {
  await page.goto(`${server.address}/?stream=object&token=${kWrong}#mode=normals`);
  await page.getByLabel('Token').fill(`${kToken} `);
  await page.getByRole('button', { name: 'Watch' }).click();
  await shownPast(page, 1);
  assert.match(page.url(), /\/\?stream=object(#mode=normals)?$/); // the page may write its own
  assert.equal(await page.evaluate(() => window.relievo.diagnostics().mode), 'normals');
};

checks['a browser that keeps no cookies is told so'] = async () => {
  const strict = await browser.newPage();
  await strict.route(/token=/, async (route) => {
    const response = await route.fetch({ maxRedirects: 0 });
    const { 'set-cookie': refused, ...headers } = response.headers();
    assert.ok(refused !== undefined);
    await strict.context().clearCookies(); // which this request has kept
    await route.fulfill({ response, headers });
  });
  await strict.goto(`${server.address}/?stream=object&token=${kToken}#mode=normals`);
  assert.match(await strict.textContent('[role=alert]'), /did not keep it: allow cookies/);
  assert.equal(await strict.locator('input[name=stream]').getAttribute('value'), 'object');
  await strict.close();
};

checks['a page that is let in already stays, though the small picture of a list is not any more'] = async () => {
  const refused = page.waitForResponse((response) => response.status() === 401 && response.url().endsWith('/ws/object'));
  await page.evaluate(() => void (window.kept_ = true));
  writeFileSync(tokens, 'another-token-for-this-test\n');
  await page.keyboard.press('n');
  await refused;
  await shownPast(page, (await page.evaluate(() => window.relievo.diagnostics().shown)) + 5);
  assert.ok(await page.evaluate(() => window.kept_), 'it was loaded anew');
  writeFileSync(tokens, `${kToken}\n`);
};

checks['a recording that is refused goes on by itself, and the list says why it is not known, until somebody signs in elsewhere'] = async () => {
  const kOther = 'one-more-token-for-this-test';
  await page.goto(`${server.address}/?recording=long.mcap#time=0&play=0`);
  await shownPast(page, 1);
  await page.evaluate(() => void (window.kept_ = true));
  writeFileSync(tokens, `${kOther}\n`);
  await page.keyboard.press('n');
  let frame = 4;
  await eventually('all of it was there already', async () => {
    await seek(page, (frame = (frame + 5) % 36)); // some parts came as it was opened, with its index
    await page.waitForTimeout(1000);
    return (await page.evaluate(() => window.relievo.diagnostics().state)) === 'stalled';
  });
  await page.waitForFunction(() => /wants a token/.test(document.querySelector('#card-text').textContent));
  await page.waitForFunction(() => /wants a token/.test(document.querySelector('.streams small')?.textContent));
  await screenshot('refused recording');
  await page.context().request.get(`${server.address}/?token=${kOther}`); // as another tab of this browser does
  await inState(page, 'file');
  await page.waitForFunction((at) => window.relievo.diagnostics().playback.index === at && !/wants a token/.test(document.querySelector('.streams small').textContent), frame);
  assert.ok(await page.evaluate(() => window.kept_), 'it was loaded anew');
  writeFileSync(tokens, `${kToken}\n`);
  await page.context().request.get(`${server.address}/?token=${kToken}`);
};

checks['what is stopped is not lost where a lost connection comes back to a token that is not known any more'] = async () => {
  const kOther = 'a-fourth-token-for-this-test';
  const stopped = await browser.newPage();
  stopped.setDefaultTimeout(kPatienceMs);
  let cut;
  await stopped.routeWebSocket(/\/ws\//, (socket) => {
    const far = socket.connectToServer();
    cut = () => Promise.all([far.close(), socket.close()]);
  });
  await stopped.goto(`${server.address}/?stream=object&token=${kToken}`);
  await shownPast(stopped, 3);
  await stopped.keyboard.press('Space');
  await inState(stopped, 'shifted');
  await stopped.evaluate(() => void (window.kept_ = true));
  writeFileSync(tokens, `${kOther}\n`);
  await cut();
  await stopped.waitForFunction(() => /Token needed/.test(document.querySelector('#badge-text').textContent));
  await stopped.waitForTimeout(3000);
  assert.ok(await stopped.evaluate(() => window.kept_), 'it was loaded anew');
  await stopped.context().request.get(`${server.address}/?token=${kOther}`); // as another tab of this browser does
  await stopped.waitForFunction(() => !/Token/.test(document.querySelector('#badge-text').textContent));
  await stopped.keyboard.press('l');
  await inState(stopped, 'live');
  assert.ok(await stopped.evaluate(() => window.kept_), 'it was loaded anew at last');
  // Nothing is lost of what is live.
  writeFileSync(tokens, `${kToken}\n`);
  await cut();
  await stopped.waitForSelector('input[name=token]');
  await stopped.close();
};

checks['one that was kept, and is not known any more, is asked for anew, also in the page of the rig'] = async () => {
  await page.goto(`${server.address}/rig?stream=object`);
  await page.waitForFunction(() => document.querySelector('#picture').width > 4);
  writeFileSync(tokens, 'another-token-for-this-test\n');
  await page.waitForSelector('input[name=token]');
  assert.match(await page.textContent('[role=alert]'), /kept is not known here any more/);
  await page.goto(server.address);
  assert.match(await page.textContent('[role=alert]'), /kept is not known here any more/);
};

checks['nothing that the page has is refused'] = async () => {
  assert.deepEqual(complaints.filter((text) => /Security Policy|Refused|error/i.test(text) && !/status of 401/.test(text)), []);
};

let failed = 1;
try {
  failed = await runChecks(checks, page);
} finally {
  await browser.close();
  await server.kill();
  rmSync(scratch, { recursive: true, force: true });
}
process.exit(failed === 0 ? 0 : 1);
