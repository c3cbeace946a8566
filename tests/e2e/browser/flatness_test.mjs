// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium: what the page says of a flat wall and of a ball is what `relievo measure` says of the same
// frame and region; the region is chosen by clicks, by fingers and by keys; over frames there is noise, over a step none. With
// a folder: makes pictures of it there.
// Run as: in_own_domain node flatness_test.mjs RELIEVO_SERVER RELIEVO [SCREENSHOTS], in web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { eventually, launchChromium } from './chromium.mjs';
import { inState, look, pagesOf, runChecks, shownPast, still } from './feeder.mjs';
import { recordObject } from './recorded.mjs';
import { startWeb } from './web.mjs';

const [serverPath, relievoPath, screenshots] = process.argv.slice(2);
const folder = mkdtempSync(join(tmpdir(), 'relievo-flatness-'));
const kFrames = 4;
const kWide = { viewport: { width: 1400, height: 800 }, colorScheme: 'light' };
const kPhone = { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true };
const kBall = [250, 170, 140, 140];

/** A ball whose box the simulator makes 150 mm in half its diagonal, a metre away. */
function writeBall(file) {
  const [around, down, lines] = [120, 60, []];
  for (let i = 0; i <= down; ++i) {
    for (let j = 0; j < around; ++j) {
      const [polar, turn] = [(Math.PI * i) / down, (2 * Math.PI * j) / around];
      lines.push(`v ${Math.sin(polar) * Math.cos(turn)} ${Math.cos(polar)} ${Math.sin(polar) * Math.sin(turn)}`);
    }
  }
  for (let i = 0; i < down; ++i) {
    for (let j = 0; j < around; ++j) {
      const [a, b] = [i * around + j + 1, i * around + ((j + 1) % around) + 1];
      lines.push(`f ${a} ${a + around} ${b + around} ${b}`);
    }
  }
  writeFileSync(file, `${lines.join('\n')}\n`);
  return file;
}

const size = 'width=640,height=480,distortion=1';
const record = (name, scene) => recordObject(serverPath, join(folder, name), { rate: 6, frames: kFrames, scene, size });
const wall = record('wall.mcap', 'plane');
const ball = record('ball.mcap', `mesh:${writeBall(join(folder, 'ball.obj'))}`);
const large = recordObject(serverPath, join(folder, 'large.mcap'), { rate: 2, frames: 2, scene: 'plane', size: 'width=1920,height=1080' });
const command = (file, ...options) => JSON.parse(execFileSync(relievoPath, ['measure', file, '--json', '-q', ...options], { encoding: 'utf8' }));

/** Every number alike: the page's arithmetic differs in rounding alone. */
function alike(page, said, at = '') {
  if (typeof said === 'number') {
    assert.ok(Math.abs(page - said) <= 1e-6 + 1e-4 * Math.abs(said), `${at}: the page says ${page}, the command ${said}`);
  } else if (said === null || typeof said === 'string') {
    assert.equal(page, said, at);
  } else {
    assert.deepEqual(Object.keys(page).sort(), Object.keys(said).sort(), at);
    for (const key of Object.keys(said)) alike(page[key], said[key], `${at} ${key}`);
  }
}

const flatness = async (page) => (await look(page)).flatness;
const choose = (page, name) => page.click(`#panel-measure .segments button:text-is("${name}")`);
const region = (page) => page.inputValue('#panel-measure .flatness input');
async function typeRegion(page, text) {
  await page.fill('#panel-measure .flatness input', text);
  await page.press('#panel-measure .flatness input', 'Enter');
}
/** Paused on this frame of the recording, and that one measured, alone. */
async function onFrame(page, index) {
  await page.keyboard.press('Home');
  for (let i = 0; i < index; ++i) await page.keyboard.press('.');
  await page.waitForFunction((wanted) => {
    const { playback, busy } = window.relievo.diagnostics();
    return playback.index === wanted && !playback.playing && !busy;
  }, index);
  await still(page);
}
async function begin(page) {
  await inState(page, 'file'); // before, the stream that it is played as may be shown
  await shownPast(page, 1);
  await page.keyboard.press('End');
  await page.keyboard.press('c');
  await page.keyboard.press('m');
  await choose(page, 'Flatness');
  await onFrame(page, 0);
}
/** Once the page says what is wanted of it. */
const measured = (page, wanted) =>
  eventually('it is not measured', async () => {
    const said = await flatness(page);
    return said !== null && wanted(said);
  });

const onWall = {
  async 'of each frame the page says what the command says'(page) {
    await begin(page);
    for (let i = 0; i < kFrames; ++i) {
      await onFrame(page, i);
      const said = command(wall, '--frames', `${i}:${i}`);
      assert.equal(said.frames, 1);
      await measured(page, ({ depth_mm, frames }) => frames === 1 && Math.abs(depth_mm.median - said.depth_mm.median) < 1e-5);
      alike(await flatness(page), said, `frame ${i}`);
    }
    const words = await page.innerText('#panel-measure .flatness');
    assert.match(words, /Error\s+RMS 0\.0\d{3} mm/);
    assert.match(words, /Expected\s+RMS 0\.0\d{3} mm/);
    assert.match(words, /Red is [\d.]+ mm before the shape/);
    if (screenshots) await page.screenshot({ path: join(screenshots, 'flatness.png') });
  },

  async 'a region is chosen by two clicks, and by its numbers'(page) {
    await onFrame(page, 1);
    const at = await page.evaluate(() => window.relievo.diagnostics().cameraPicture);
    const scale = at.width / 640;
    const click = (column, row) => page.mouse.click(at.x + (column + 0.5) * scale, at.y + (row + 0.5) * scale);
    await click(300, 300);
    assert.match(await page.textContent('#panel-measure'), /opposite corner/);
    await click(100, 120);
    await page.waitForFunction(() => document.querySelector('#panel-measure .flatness input').value.startsWith('100,120,'));
    const chosen = await region(page);
    assert.match(chosen, /^100,120,20[12],18[12]$/);
    await measured(page, (said) => said.region.join() === chosen);
    alike(await flatness(page), command(wall, '--frames', '1:1', '--region', chosen));
    await typeRegion(page, '40,30,200,90');
    await measured(page, (said) => said.region[2] === 200);
    alike(await flatness(page), command(wall, '--frames', '1:1', '--region', '40,30,200,90'));
    await typeRegion(page, '600,30,200,90');
    await page.waitForFunction(() => /within the camera's picture of 640x480/.test(document.querySelector('#panel-measure').textContent));
    assert.deepEqual((await flatness(page)).region, [40, 30, 200, 90]);
    await page.click('#panel-measure .flatness button:text-is("Middle")');
    await measured(page, (said) => said.region[2] === 256);
  },

  async 'the panel stays where it is as the mouse comes to it from the picture'(page) {
    const middle = page.locator('#panel-measure .flatness button:text-is("Middle")');
    await middle.scrollIntoViewIfNeeded();
    const places = async () => {
      // Observers of sizes have been told by then.
      await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));
      return [await middle.boundingBox(), await page.locator('#timeline').boundingBox()];
    };
    const at = await page.evaluate(() => window.relievo.diagnostics().cameraPicture);
    await page.mouse.move(at.x + at.width / 2, at.y + at.height / 2);
    await page.waitForSelector('#cursor', { state: 'visible' });
    const before = await places();
    await page.mouse.move(2, 2);
    await page.waitForSelector('#cursor', { state: 'hidden' });
    assert.deepEqual(await places(), before);
  },

  async 'what is read of a place does not hide it'(page) {
    const line = page.locator('#cursor');
    const at = await page.evaluate(() => window.relievo.diagnostics().cameraPicture);
    await page.mouse.move(at.x + at.width / 2, at.y + at.height / 2);
    await line.waitFor({ state: 'visible' });
    const { x, y, width, height } = await line.boundingBox();
    const place = { x: Math.max(x + width / 2, at.x + 20), y: y + height / 2 };
    await page.mouse.move(place.x, place.y);
    await eventually('it stays over the place that is pointed at', async () => {
      const now = await line.boundingBox();
      return now !== null && now.y + now.height < place.y - 10;
    });
    await page.mouse.move(at.x + at.width / 2, at.y + at.height / 2);
    await eventually('it does not come back', async () => (await line.boundingBox())?.y === y);
    await page.mouse.move(2, 2);
  },

  async 'while it plays there is noise, of the frames that came'(page) {
    await page.focus('#view');
    for (let i = 0; i < 9; ++i) await page.keyboard.press('<'); // else a slow page measures one of them
    await eventually('no two frames are measured one after the other', async () => {
      if (!(await look(page)).playback.playing) {
        await page.keyboard.press('Home');
        await page.keyboard.press('Space');
      }
      const said = await flatness(page);
      return said !== null && said.frames > 1 && said.noise_mm > 0 && said.form_mm < said.rms_mm.median;
    });
    await onFrame(page, 2); // alone again
    await measured(page, ({ frames, noise_mm }) => frames === 1 && noise_mm === null);
  },

  async 'a step after it has played shows the figures of that frame alone'(page) {
    await page.focus('#view');
    await eventually('what has played is gone as it is stopped, or it has always come to its end before', async () => {
      await page.keyboard.press('Home');
      await page.keyboard.press('Space');
      await measured(page, ({ frames }) => frames >= 2);
      await page.keyboard.press('Space');
      await still(page);
      return (await flatness(page))?.frames >= 2 && (await look(page)).playback.index < kFrames - 1;
    });
    const { index } = (await look(page)).playback;
    await page.keyboard.press('.');
    const said = command(wall, '--frames', `${index + 1}:${index + 1}`, '--region', await region(page));
    await measured(page, ({ frames }) => frames === 1);
    alike(await flatness(page), said);
    for (let i = 0; i < 3; ++i) await page.keyboard.press('>');
  },

  async 'without a shape it says so'(page) {
    await typeRegion(page, '10,10,5,5');
    await page.waitForFunction(() => /no plane in the region/.test(document.querySelector('#panel-measure').innerText));
    assert.equal(await flatness(page), null);
  },
};

const onBall = {
  async 'of a ball the page says what the command says'(page) {
    await begin(page);
    await choose(page, 'Sphere');
    await typeRegion(page, kBall.join());
    const said = command(ball, '--frames', '0:0', '--shape', 'sphere', '--region', kBall.join());
    await measured(page, ({ shape, region: [column] }) => shape === 'sphere' && column === kBall[0]);
    alike(await flatness(page), said);
    assert.ok(Math.abs((await flatness(page)).radius_mm.median - 150 / Math.sqrt(3)) < 0.2);
    assert.match(await page.innerText('#panel-measure .flatness'), /Radius\s+86\.\d{3} mm/);
    await page.keyboard.press('t'); // which closes the panel of measuring
    const link = new URL(await page.evaluate(() => window.relievo.link()));
    const other = await pagesOf(browser, link.origin, complaints).open(link.pathname + link.search + link.hash, kWide);
    await inState(other, 'file');
    await measured(other, ({ shape, frames, centre_mm }) => shape === 'sphere' && frames === 1 && Math.abs(centre_mm[0].median - said.centre_mm[0].median) < 1e-4);
    alike(await flatness(other), said);
    assert.equal(await region(other), kBall.join());
    await other.close();
    await page.keyboard.press('m');
    await measured(page, ({ shape }) => shape === 'sphere');
    if (screenshots) await page.screenshot({ path: join(screenshots, 'flatness-ball.png') });
  },
};

/** From the first frame to the second, by the time line, which nothing lies over, and that one is measured. */
async function steps(page) {
  const boxes = () => page.evaluate(() => ['#timeline', '#panel-measure', '#rail'].map((of) => document.querySelector(of).getBoundingClientRect().toJSON()));
  let found;
  await eventually(() => `the time line is covered: ${JSON.stringify(found)}`, async () => {
    found = await boxes();
    const [line, ...others] = found;
    const apart = (other) => other.left >= line.right || other.right <= line.left || other.top >= line.bottom || other.bottom <= line.top;
    return line.width > 200 && line.left >= 0 && line.bottom <= page.viewportSize().height && others.every(apart);
  });
  const said = command(wall, '--frames', '1:1', '--region', await region(page));
  await page.getByRole('button', { name: 'A frame ahead' }).tap();
  await measured(page, ({ frames, depth_mm }) => frames === 1 && Math.abs(depth_mm.median - said.depth_mm.median) < 1e-5);
  const beyond = await page.$$eval('#timeline > *', (all) => all.filter((e) => e.getClientRects().length > 0 && e.getBoundingClientRect().right > document.querySelector('#timeline').getBoundingClientRect().right).map((e) => e.className || e.textContent));
  assert.deepEqual(beyond, []);
}

const byFinger = {
  async 'on a phone by two taps, for which the panel folds, and everything is within the screen'(page) {
    await begin(page);
    await measured(page, ({ shape }) => shape === 'plane');
    const top = async () => (await page.locator('#panel-measure').boundingBox()).y;
    const at = await page.evaluate(() => window.relievo.diagnostics().cameraPicture);
    const [left, upper, right, lower] = [at.x + 0.2 * at.width, at.y + 0.1 * at.height, at.x + 0.7 * at.width, at.y + 0.95 * at.height];
    assert.ok((await top()) < lower, 'the panel hides nothing');
    await page.touchscreen.tap(left, upper);
    await page.waitForFunction(() => /opposite corner/.test(document.querySelector('#panel-measure').innerText));
    assert.ok((await top()) > at.y + at.height, 'the panel lies over the other corner');
    await page.touchscreen.tap(right, lower);
    await measured(page, (said) => said.region[0] > 100 && said.region[0] < 150 && said.region[3] > 390);
    alike(await flatness(page), command(wall, '--frames', '0:0', '--region', await region(page)));
    assert.equal(await page.getAttribute('#panel-measure .fold', 'aria-expanded'), 'false');
    assert.match(await page.innerText('#panel-measure'), /Away \d+\.\d{3} mm · RMS 0\.0\d{3} mm/);
    if (screenshots) await page.screenshot({ path: join(screenshots, 'flatness-phone-folded.png') });
    await steps(page);
    await page.keyboard.press('Home');
    await still(page);
    await page.tap('#panel-measure .fold');
    assert.ok((await top()) < lower, 'the panel stays folded');
    if (screenshots) await page.screenshot({ path: join(screenshots, 'flatness-phone.png') });
    const beyond = await page.$$eval('#panel-measure *', (all) => all.filter((e) => e.getClientRects().length > 0 && (e.getBoundingClientRect().right > innerWidth || e.getBoundingClientRect().left < 0)).map((e) => e.className || e.tagName));
    assert.deepEqual(beyond, []);
    await choose(page, 'Distance');
    await page.touchscreen.tap(left, upper);
    await page.waitForFunction(() => document.querySelector('#panel-measure .fold').getAttribute('aria-expanded') === 'false');
    await page.touchscreen.tap(right, lower);
    await page.waitForFunction(() => /Distance \d+\.\d/.test(document.querySelector('#panel-measure').innerText));
  },
};

const onItsSide = {
  async 'on a phone on its side the time line stays beside the panel'(page) {
    await begin(page);
    await measured(page, ({ shape }) => shape === 'plane');
    await steps(page);
  },
};

const byKeys = {
  async 'by keys, from the tool to the corners'(page) {
    await begin(page);
    await page.focus('#view');
    await page.keyboard.press('o'); // of the surface as it is seen, not of the camera's picture
    for (const corner of ['first', 'second']) {
      await page.keyboard.press('Enter'); // aims
      await page.keyboard.press('Enter');
      if (corner === 'first') {
        await page.waitForFunction(() => /opposite corner/.test(document.querySelector('#panel-measure').textContent));
        for (let i = 0; i < 3; ++i) await page.keyboard.press('Shift+ArrowLeft');
        await page.keyboard.press('Shift+ArrowUp');
        await still(page);
      }
    }
    await measured(page, (said) => said.region[2] !== 256);
    alike(await flatness(page), command(wall, '--frames', '0:0', '--region', await region(page)));
  },
};

const onLarge = {
  async 'a whole large picture is measured beside the page\'s own thread'(page) {
    await begin(page);
    await typeRegion(page, '0,0,1920,1080');
    await measured(page, (said) => said.region[2] === 1920);
    alike(await flatness(page), command(large, '--frames', '0:0', '--region', '0,0,1920,1080'));
    assert.ok(page.workers().some((worker) => /shape/.test(worker.url())), 'the page itself measures');
    assert.ok((await page.$eval('#panel-measure .flatness canvas', ({ width }) => width)) <= 640);
  },
};

const withoutMeasurer = {
  async 'where what measures does not come it says so, and measures once it does'(page) {
    let [comes, tried] = [false, 0];
    await page.route(/assets\/shape\.worker/, (route) => (++tried, comes ? route.continue() : route.abort()));
    await begin(page);
    await page.waitForFunction(() => /cannot be loaded/.test(document.querySelector('#panel-measure .flatness .warn').textContent));
    let [before, drawn] = [tried, 0];
    await eventually('it is not tried again, or the picture is drawn anew at each try', async () => {
      const now = (await look(page)).drawn;
      if (now !== drawn) [before, drawn] = [tried, now]; // once more where a word has gone from over it
      return tried > before + 1;
    });
    comes = true;
    await measured(page, ({ shape }) => shape === 'plane');
    await page.waitForFunction(() => document.querySelector('#panel-measure .flatness .warn').hidden);
    complaints.splice(0, complaints.length, ...complaints.filter((complaint) => !/ERR_FAILED/.test(complaint)));
  },
};

const browser = await launchChromium();
const complaints = [];
let failed = 0;
async function checkOn(file, parts) {
  const web = await startWeb(relievoPath, file);
  try {
    for (const [checks, options] of parts) {
      const page = await pagesOf(browser, web.address.replace(/\/$/, ''), complaints).open('/', options);
      failed += await runChecks(checks, page);
      await page.close();
    }
  } finally {
    await web.stop();
  }
}
try {
  await checkOn(wall, [[onWall, kWide], [withoutMeasurer, { ...kWide, serviceWorkers: 'block' }], [byFinger, kPhone], [onItsSide, { ...kPhone, viewport: { width: 844, height: 390 } }], [byKeys, kWide]]);
  await checkOn(large, [[onLarge, kWide]]);
  await checkOn(ball, [[onBall, { ...kWide, colorScheme: 'dark' }]]);
  assert.deepEqual(complaints, []);
} finally {
  await browser.close();
  rmSync(folder, { recursive: true });
}
process.exit(failed === 0 ? 0 : 1);
