// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium: what is measured with the mouse is true. First on the feeder's known surface, then
// through the whole chain on the simulator's cube of 100 mm, with the standard deviations that the server sends: on its face,
// and from corner to corner, where clicks snap, live and in a recording, and by a link on another page.
// Run as: in_own_domain node measure_test.mjs GATEWAY_FEEDER RELIEVO_SERVER RELIEVO, in web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { eventually, kLongPatienceMs, launchChromium } from './chromium.mjs';
import { Feeder, inState, isRim, loaded, look, pagesOf, pointOf, restingPlace, runChecks, shownPast, still } from './feeder.mjs';
import { recordObject } from './recorded.mjs';
import { Server } from './server.mjs';
import { startWeb } from './web.mjs';

const [feederPath, serverPath, relievoPath] = process.argv.slice(2);
const feeder = await Feeder.start(feederPath);
const browser = await launchChromium();
const complaints = [];
const kFrame = 62; // the ball is in the middle
const kPage = { viewport: { width: 1600, height: 800 } }; // the panel covers nothing that is measured
const kLargePage = { viewport: { width: 2400, height: 1200 } }; // nor the time line of so wide a picture
const { open } = pagesOf(browser, `http://127.0.0.1:${feeder.port}`, complaints);

const click = async (page, point) => {
  const at = await restingPlace(page, point);
  await page.mouse.click(at.x, at.y);
};
const choose = (page, tool) => page.click(`#panel-measure .segments button:text-is("${tool}")`);
/** Measures with a tool by clicking at these points of the surface. */
async function measure(page, tool, points) {
  const count = (await look(page)).measurements.length;
  await choose(page, tool);
  for (const point of points) await click(page, point);
  await page.waitForFunction((n) => window.relievo.diagnostics().measurements.length > n, count);
  return (await look(page)).measurements.at(-1);
}
const away = (a, b) => Math.hypot(...a.map((c, i) => c - b[i]));
const near = (a, b, within, what) => assert.ok(Math.abs(a - b) <= within, `${what}: ${a}, not ${b}`);
async function saved(page, name) {
  const [file] = await Promise.all([page.waitForEvent('download'), page.click(`#panel-measure button:text-is("${name}")`)]);
  return { name: file.suggestedFilename(), text: readFileSync(await file.path(), 'utf8') };
}

const onFeeder = {
  async 'distances and angles are true'(page) {
    feeder.say('start ball');
    await shownPast(page, 2);
    await feeder.standStill(page, kFrame); // one surface from here on
    await still(page);
    await page.keyboard.press('c');
    await page.keyboard.press('m');
    await still(page);
    const { frame } = await look(page);
    const [a, b, c] = [pointOf(0.2, 0.2, frame), pointOf(0.52, 0.55, frame), pointOf(0.25, 0.8, frame)];
    near((await measure(page, 'Distance', [a, b])).value, away(a, b), 0.001, 'distance');
    near((await measure(page, 'Point', [b])).value, b[2], 0.0006, 'depth');
    assert.equal((await look(page)).way, 'camera', 'a click has left the camera');
    const angle = await measure(page, 'Angle', [a, b, c]);
    const cosine = a.reduce((sum, _, i) => sum + (a[i] - b[i]) * (c[i] - b[i]), 0) / (away(a, b) * away(c, b));
    near(angle.value, Math.acos(cosine), 0.004, 'angle');
    assert.equal(angle.sigma, null); // the feeder says nothing of it
    assert.match(await page.textContent('#panel-measure'), /there is no ±/);
  },

  async 'a section is the profile of the surface'(page) {
    const { frame } = await look(page);
    const m = await measure(page, 'Section', [pointOf(0.15, 0.5, frame), pointOf(0.85, 0.5, frame)]);
    assert.ok(m.profile.length > 100, `${m.profile.length} pieces`);
    const places = m.profile.map(([{ point: [x, , z] }]) => ({ u: (x * 800) / (640 * z) + 0.5, z }));
    const smooth = places.filter(({ u }) => !isRim(u, 0.5, frame));
    assert.ok(smooth.length > places.length / 2, `${smooth.length} of ${places.length} places`);
    for (const { u, z } of smooth) near(z, pointOf(u, 0.5, frame)[2], 0.002, `depth of the section at ${u}`);
    assert.ok(await page.isVisible('#panel-measure .plot'));
    const { name, text } = await saved(page, 'Section CSV');
    assert.equal(name, 'relievo-section.csv');
    assert.ok(text.startsWith('along_m,height_m,sigma_m,x_m,y_m,z_m\n') && text.split('\n').length > 100);
  },

  async 'the table holds them all'(page) {
    const { text } = await saved(page, 'CSV');
    assert.deepEqual(text.trim().split('\n').map((line) => line.split(',')[0]), ['tool', 'distance', 'point', 'angle', 'section']);
    await page.click('#panel-measure button:text-is("Clear")');
    await page.waitForFunction(() => window.relievo.diagnostics().measurements.length === 0);
  },

  async 'what the rig itself is wrong by is in it'(page) {
    feeder.say('rig 0.4 0.01');
    let said;
    let i = 0;
    await eventually(() => `under the cursor is ${said}`, async () => {
      await page.mouse.move(750 + (++i % 2), 400); // which reads again
      said = await page.textContent('#cursor');
      return /depth [\d.]+ ± [\d.]+ mm/.test(said);
    });
    const { frame } = await look(page);
    const m = await measure(page, 'Distance', [pointOf(0.2, 0.2, frame), pointOf(0.52, 0.55, frame)]);
    assert.equal(m.surface, null);
    assert.ok(m.sigma > 0.01 * m.value && m.sigma < 0.02 * m.value, `${m.sigma} of ${m.value}`); // 1 % of it, and depth's
    const { value: depth, rig } = await measure(page, 'Point', [pointOf(0.5, 0.5, frame)]);
    // Straight ahead z² rms / (f b), and 1 %: both devices have 800 px, 0.2 m apart.
    near(rig, Math.hypot((depth * depth * 0.4) / (800 * 0.2), 0.01 * depth), 0.03 * rig, 'of depth');
    assert.match(await page.textContent('#panel-measure'), /of the rig as its calibration found it/);
    await page.click('#panel-measure button:text-is("Clear")');
    await page.waitForFunction(() => window.relievo.diagnostics().measurements.length === 0);
  },

  async 'a drag measures nothing, a miss says so'(page) {
    await choose(page, 'Point');
    await page.mouse.move(700, 400);
    await page.mouse.down();
    await page.mouse.move(740, 410, { steps: 3 });
    await page.mouse.up();
    assert.equal((await look(page)).measurements.length, 0);
    await page.keyboard.press('c'); // beside the camera's picture there is none
    await still(page);
    await page.mouse.click(5, 400);
    await page.waitForFunction(() => /no surface/.test(document.querySelector('#panel-measure')?.textContent));
  },

  async 'no error, no request to another host'() {
    assert.deepEqual(complaints, []);
  },
};

/** Of the simulator's cube of 100 mm (capture/source/sim/scenes_simple.cpp), on the face to the camera's left. */
function onCube(right, down, back = -0.05) {
  const [s, c] = [Math.sin(0.5), Math.cos(0.5)];
  const local = [right, down, back];
  return [0.12 + c * local[0] + s * local[2], 0.078 + local[1], 0.95 - s * local[0] + c * local[2]];
}

const onServer = {
  async 'a cube of 100 mm reads true, and says how exactly'(page) {
    await shownPast(page, 2);
    await page.keyboard.press('c');
    await page.keyboard.press('m');
    for (const [from, to] of [
      [[-0.03, -0.035], [-0.03, 0.035]],
      [[-0.03, 0], [0.03, 0]],
      [[-0.035, -0.03], [0.03, 0.035]],
    ]) {
      const [a, b] = [onCube(...from), onCube(...to)];
      const m = await measure(page, 'Distance', [a, b]);
      console.log(`      ${(away(a, b) * 1000).toFixed(2)} mm reads ${(m.value * 1000).toFixed(2)} ± ${(m.sigma * 1000).toFixed(2)} mm`);
      near(m.value, away(a, b), 0.0005, 'distance on the cube');
      assert.ok(m.sigma > 1e-6 && m.sigma < 0.001, `standard deviation ${m.sigma}`);
    }
  },

  async 'the readout under the cursor says depth and deviation'(page) {
    const at = await restingPlace(page, onCube(0, 0));
    await page.mouse.move(at.x, at.y);
    const said = await page.waitForFunction(() => /depth ([\d.]+) ± [\d.]+ mm/.exec(document.querySelector('#cursor')?.textContent)?.[1]);
    assert.match(await page.textContent('#panel-measure'), /±: one standard deviation.*calibration adds its own/);
    const depth = Number(await said.jsonValue());
    near(depth, onCube(0, 0)[2] * 1000, 1, 'depth under the cursor');
  },
};

const kEdge = 0.05; // half of it
const kCorners = {
  frontLeftTop: onCube(-kEdge, -kEdge),
  frontRightTop: onCube(kEdge, -kEdge),
  frontRightBottom: onCube(kEdge, kEdge),
  frontLeftBottom: onCube(-kEdge, kEdge),
  backRightBottom: onCube(kEdge, kEdge, kEdge),
  backRightTop: onCube(kEdge, -kEdge, kEdge),
};
const kFront = [['frontLeftTop', 'frontRightTop'], ['frontRightTop', 'frontRightBottom'], ['frontRightBottom', 'frontLeftBottom'], ['frontLeftBottom', 'frontLeftTop'], ['frontLeftTop', 'frontRightBottom']];
// At 640x480 the cube's upper face is two lines and the side face six stripes: where those end is not known so exactly.
const kSide = [['frontRightBottom', 'backRightBottom']];
const kFarTop = [['frontRightTop', 'backRightTop'], ['backRightTop', 'backRightBottom']];

/** Clicks near two corners, as a hand does, and gives what was measured. */
async function clickCorners(page, from, to) {
  const count = (await look(page)).measurements.length;
  for (const [i, corner] of [kCorners[from], kCorners[to]].entries()) {
    const at = await restingPlace(page, corner);
    await page.mouse.click(at.x + (i === 0 ? -4 : 3), at.y + 3);
  }
  await page.waitForFunction((n) => window.relievo.diagnostics().measurements.length > n, count).catch(async () => assert.fail(`${from} to ${to}: ${await page.textContent('#panel-measure')}`));
  return (await look(page)).measurements.at(-1);
}

async function cornerToCorner(page, pairs) {
  for (const [from, to] of pairs) {
    const m = await clickCorners(page, from, to);
    const truth = away(kCorners[from], kCorners[to]);
    console.log(`      ${from} to ${to}: ${(truth * 1000).toFixed(1)} mm reads ${(m.value * 1000).toFixed(2)} ± ${(m.sigma * 1000).toFixed(2)} mm`);
    assert.deepEqual(m.spots.map(({ kind }) => kind), ['corner', 'corner'], `${from} to ${to}`);
    near(m.value, truth, 0.0005, `${from} to ${to}`);
    assert.ok(Math.abs(m.value - truth) < 4 * m.sigma && m.sigma < 0.0008, `${m.value} ± ${m.sigma}`);
  }
}

async function beginMeasuring(page) {
  await shownPast(page, 2);
  await page.keyboard.press('c');
  await page.keyboard.press('m');
  await choose(page, 'Distance');
  await shownPast(page, (await look(page)).shown + 3); // with its standard deviations
}

const corners = {
  async 'from corner to corner of the front face'(page) {
    await beginMeasuring(page);
    await cornerToCorner(page, kFront);
    const { text } = await saved(page, 'CSV');
    const [head, line] = text.split('\n').map((row) => row.split(','));
    assert.equal(line[head.indexOf('kind1')], 'corner');
    assert.match(await page.textContent('#panel-measure .measurements'), /corner – corner/);
  },

  async 'a point on an edge is on it, and Alt leaves a click where it is'(page) {
    await choose(page, 'Point');
    const place = onCube(-0.02, kEdge - 0.002);
    await click(page, place);
    await page.waitForFunction(() => window.relievo.diagnostics().measurements.at(-1)?.tool === 'point');
    const [edge] = (await look(page)).measurements.at(-1).spots;
    assert.equal(edge.kind, 'edge');
    near(edge.point[1], onCube(0, kEdge)[1], 0.0004, 'height of the lower edge');
    const count = (await look(page)).measurements.length;
    await page.keyboard.down('Alt');
    await click(page, onCube(-0.02, kEdge - 0.006));
    await page.keyboard.up('Alt');
    await page.waitForFunction((n) => window.relievo.diagnostics().measurements.length > n, count);
    const [free] = (await look(page)).measurements.at(-1).spots;
    assert.equal(free.kind, 'surface');
    near(free.point[1], onCube(0, kEdge - 0.006)[1], 0.001, 'height of the place');
  },

  async 'what a click would be on is shown before'(page) {
    const at = await restingPlace(page, kCorners.frontRightTop);
    await page.mouse.move(at.x + 3, at.y + 3);
    await page.waitForFunction(() => /^corner · depth/.test(document.querySelector('#cursor')?.textContent));
    const middle = await restingPlace(page, onCube(0, 0));
    await page.mouse.move(middle.x, middle.y);
    await page.waitForFunction(() => /^depth/.test(document.querySelector('#cursor')?.textContent));
  },

  async 'by a switch it is off, and stays so'(page) {
    const snapping = page.getByLabel('Snap to edges and corners');
    await snapping.uncheck();
    const count = (await look(page)).measurements.length;
    await click(page, onCube(0.04, 0.03));
    await page.waitForFunction((n) => window.relievo.diagnostics().measurements.length > n, count);
    assert.equal((await look(page)).measurements.at(-1).spots[0].kind, 'surface');
    await page.reload();
    await loaded(page);
    await shownPast(page, 1);
    await page.keyboard.press('m');
    await page.waitForSelector('#panel-measure .segments');
    assert.equal(await snapping.isChecked(), false);
    await snapping.check();
  },

  async 'by keys: arrows bring the place to the middle, Enter measures there'(page) {
    await choose(page, 'Point');
    await page.keyboard.press('o');
    await page.focus('#view');
    const count = (await look(page)).measurements.length;
    await page.keyboard.press('ArrowLeft');
    await page.waitForFunction(() => /depth/.test(document.querySelector('#cursor')?.textContent));
    // The object turns, and a frame may have a hole just there.
    await eventually('nothing is measured in the middle', async () => {
      await page.keyboard.press('Enter');
      return (await look(page)).measurements.length > count;
    });
  },
};

const edgesOf = (pairs) => ({
  async 'from corner to corner'(page) {
    await beginMeasuring(page);
    await cornerToCorner(page, pairs);
  },
});
const recordedEdgesOf = (pairs) => ({
  async 'from corner to corner in a recording'(page) {
    await page.keyboard.press('End');
    await page.waitForFunction(() => !window.relievo.diagnostics().playback.playing);
    await page.keyboard.press('c');
    await page.keyboard.press('m');
    await choose(page, 'Distance');
    await still(page);
    await cornerToCorner(page, pairs);
  },
});

const inRecording = {
  ...recordedEdgesOf(kFront), // as exact as they are live

  async 'what is read of a place is of the one where the cursor rests, though no frame follows'(page) {
    for (const name of ['frontLeftTop', 'frontRightBottom', 'frontLeftBottom']) {
      const at = await restingPlace(page, kCorners[name]);
      await page.mouse.move(at.x + 3, at.y - 3);
      const [x, y, z] = kCorners[name].map((c) => c * 1000);
      let said;
      await eventually(() => `at ${name}, ${[x, -y, z]}, it reads ${said}`, async () => {
        said = await page.textContent('#cursor');
        const read = /^corner · depth ([\d.]+) ± [\d.]+ mm · right (-?[\d.]+) · up (-?[\d.]+)$/.exec(said)?.slice(1).map(Number);
        return read !== undefined && [z, x, -y].every((c, i) => Math.abs(read[i] - c) < 1.5);
      });
    }
    const middle = await restingPlace(page, onCube(0, 0));
    await page.mouse.move(middle.x, middle.y);
    await page.waitForFunction(() => /^depth/.test(document.querySelector('#cursor').textContent));
  },

  async 'a link shows somebody else what was measured, and how exactly'(page) {
    await click(page, onCube(-0.02, 0.01)); // of a distance that is not measured to its end
    await measure(page, 'Angle', [onCube(-0.03, 0.03), onCube(-0.03, -0.03), onCube(0.03, -0.03)]);
    await page.keyboard.down('Alt');
    const section = await measure(page, 'Section', [onCube(-0.03, 0), onCube(0.03, 0)]);
    await page.keyboard.up('Alt');
    await page.keyboard.press('t'); // which closes the panel of measuring
    await page.waitForSelector('#panel-take');
    const words = (of) => of.$$eval('#panel-measure .measurements li', (all) => all.map((item) => item.textContent));
    const link = new URL(await page.evaluate(() => window.relievo.link()));
    const said = await words(page);
    assert.equal(said.length, kFront.length + 2);

    const other = await pagesOf(browser, link.origin, complaints).open(link.pathname + link.search + link.hash, kPage);
    await other.waitForSelector('#panel-measure .measurements li');
    assert.deepEqual(await words(other), said);
    await shownPast(other, 1);
    await other.waitForFunction(() => window.relievo.diagnostics().measurements.at(-1).profile.length > 0);
    const { profile } = (await look(other)).measurements.at(-1);
    assert.equal(profile.length, section.profile.length);
    const kShown = 5e-6; // half a digit; where the cut runs along an edge of the mesh a link's nanometre is most of a micrometre
    for (const [i, [{ along, height }]] of profile.entries()) {
      near(along, section.profile[i][0].along, kShown, `place ${i} of the section`);
      near(height, section.profile[i][0].height, kShown, `height ${i} of the section`);
    }
    assert.ok(await other.isVisible('#panel-measure .plot'));
    // Passed on once more it is the same, and pasted into a page that is open it takes the place of what is there.
    await other.keyboard.press('Escape');
    assert.equal(await other.evaluate(() => window.relievo.link()), link.href);
    await other.evaluate(() => (location.hash = '#measure=point_x_x__0_surface_0_0_1_x&measure=point_x_x__7_surface_0_0_1_x'));
    await other.waitForFunction(() => /^Point1000\.00 mm/.test(document.querySelector('#panel-measure .measurements').textContent));
    assert.equal((await words(other)).length, 1);
    await other.evaluate(() => (location.hash = '#mode=shaded'));
    await other.waitForFunction(() => window.relievo.diagnostics().mode === 'shaded');
    assert.equal((await words(other)).length, 1, 'a link without measurements takes away those that are there');
    await other.close();
  },
};

const byFinger = {
  async 'a tap near a corner is on it'(page) {
    await beginMeasuring(page);
    await choose(page, 'Point');
    const at = await restingPlace(page, kCorners.frontLeftBottom);
    await page.touchscreen.tap(at.x + 9, at.y - 9);
    await page.waitForFunction(() => window.relievo.diagnostics().measurements.length > 0);
    const [spot] = (await look(page)).measurements.at(-1).spots;
    assert.equal(spot.kind, 'corner');
    assert.ok(away(spot.point, kCorners.frontLeftBottom) < 0.0006, `${away(spot.point, kCorners.frontLeftBottom)}`);
  },
};

const onFace = {
  async 'a face has no edges'(page) {
    await shownPast(page, 2);
    await page.keyboard.press('c');
    await page.keyboard.press('m');
    await choose(page, 'Point');
    await shownPast(page, (await look(page)).shown + 3);
    for (let y = 120; y < 640; y += 65) for (let x = 420; x < 1080; x += 65) await page.mouse.click(x, y);
    const { measurements } = await look(page);
    assert.ok(measurements.length > 30, `${measurements.length} places`);
    const caught = measurements.flatMap(({ spots }) => spots).filter(({ kind }) => kind !== 'surface');
    assert.deepEqual(caught.map(({ kind, point }) => ({ kind, point })), []);
  },
};

let failed = 1;
let server;
let web;
const folder = mkdtempSync(join(tmpdir(), 'relievo-measure-'));
/** On a server of its own, which decodes as exactly as it can however busy the machine is. */
async function checkOn(source, checks, page = kPage) {
  server = await Server.start(serverPath, ['--source', source, '--decoder', 'ordered']);
  const opened = await pagesOf(browser, server.address, complaints).open('/', page);
  opened.setDefaultTimeout(kLongPatienceMs); // with each frame, which is computed for what is drawn of it
  failed += await runChecks(checks, opened);
  await opened.close();
  await server.kill();
}
async function checkOnFile(file, checks, page) {
  web = await startWeb(relievoPath, file);
  const opened = await pagesOf(browser, web.address.replace(/\/$/, ''), complaints).open('/', page);
  await inState(opened, 'file');
  await shownPast(opened, 1);
  failed += await runChecks(checks, opened);
  await opened.close();
  await web.stop();
}
try {
  const onBall = await open('/', kPage);
  failed = await runChecks(onFeeder, onBall);
  await onBall.close();
  await feeder.kill();
  await checkOn('sim:object,rate=5', onServer);
  // Of pixels that are the mean of what falls on them, as a camera's are: one ray a pixel puts an outline up to half of one off.
  await checkOn('sim:object,rate=5,rays=6', corners);
  await checkOn('sim:object,rate=5,rays=6', edgesOf([...kFront, ...kSide]));
  // Recorded: while it is live each of its frames takes most of a machine.
  const size = 'width=1920,height=1080,projector_width=1920,projector_height=1080,stripes=300,rays=4';
  const large = recordObject(serverPath, join(folder, 'large.mcap'), { rate: 2, frames: 2, size, options: ['--decoder', 'ordered', '--fast'] });
  await checkOnFile(large, recordedEdgesOf([...kFront, ...kSide, ...kFarTop]), kLargePage);
  const recorded = recordObject(serverPath, join(folder, 'cube.mcap'), { rate: 5, frames: 6, size: 'width=640,height=480,rays=6' });
  await checkOnFile(recorded, inRecording, kPage);
  const phone = { viewport: { width: 844, height: 780 }, hasTouch: true, isMobile: true };
  await checkOn('sim:object,rate=5,rays=6', byFinger, phone);
  await checkOn('sim:face,rate=5', onFace);
  assert.deepEqual(complaints, []);
} finally {
  await browser.close();
  await feeder.kill();
  await server?.kill();
  await web?.stop();
  rmSync(folder, { recursive: true });
}
process.exit(failed === 0 ? 0 : 1);
