// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium: the list shows each stream with its picture, and a second stream stands beside the first
// where the page says it does, is picked, measured and gone back in like the first, by a button and by the address, until it is taken away or another one is chosen;
// or stands where a person has placed it by what both see, also turned. One that is gone is dimmed and named, and can be taken away.
// Run as: node streams_test.mjs GATEWAY_FEEDER, in web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { eventually, launchChromium } from './chromium.mjs';
import { colourAt, Feeder, freeMiddle, inState, isRim, kJitter_px, kPicture, look, pagesOf, pickAt, pointOf, restingPlace, runChecks, shownPast, still, toPage } from './feeder.mjs';

const feeder = await Feeder.start(process.argv[2]);
const browser = await launchChromium();
const complaints = [];
const { open } = pagesOf(browser, `http://127.0.0.1:${feeder.port}`, complaints);
const kFrame = 62;
const kApart = 31; // frames between the two streams

/** A place of a stream's surface in its own camera's frame, how far right that stands, and where it is on the page. */
async function placeOf(page, name, u, v) {
  const [{ frame, right }] = name === 'ball' ? [{ frame: kFrame, right: 0 }] : (await look(page)).besides;
  const point = pointOf(u, v, frame);
  const { x, y } = await restingPlace(page, [point[0] + right, point[1], point[2]]);
  return { point, right, at: [x, y] };
}
const kNowhere = { rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], translation: [0, 0, 0] };
const moved = ({ rotation: r, translation: t }, p) => [0, 1, 2].map((i) => r[3 * i] * p[0] + r[3 * i + 1] * p[1] + r[3 * i + 2] * p[2] + t[i]);
const near = (a, b, within, what) => assert.ok(Math.abs(a - b) <= within, `${what}: ${a}, not ${b}`);

const besides = (page, count) =>
  page.waitForFunction((n) => window.relievo.diagnostics().besides.filter((b) => b.shown > 0).length === n, count);
const rowOf = (name) => `.streams li:has(b:text-is("${name}"))`;
/** Colours of the surface's upper corners, red and green, that stand `right` metres beside the first one. */
async function corners(page, right) {
  const { frame } = await look(page);
  const colours = [];
  for (const u of [30 / kPicture.width, 1 - 30 / kPicture.width]) {
    const [x, y, z] = pointOf(u, 30 / kPicture.height, frame);
    colours.push(await colourAt(page, [x + right, y, z]));
  }
  return colours;
}
async function assertStands(page, right) {
  const [[r, g, b], [r2, g2, b2]] = await corners(page, right);
  assert.ok(r > 150 && g < 90 && b < 90, `no red at ${right} m: ${[r, g, b]}`);
  assert.ok(r2 < 90 && g2 > 130 && b2 < 90, `no green at ${right} m: ${[r2, g2, b2]}`);
}

const checks = {
  async 'each stream is listed, with its picture'(page) {
    await shownPast(page, 2);
    await page.keyboard.press('n');
    await page.waitForFunction(() => document.querySelectorAll('.streams canvas[data-drawn]').length === 2);
    for (const name of ['ball', 'other']) {
      const [r, g] = await page.evaluate((row) => {
        const canvas = document.querySelector(row).querySelector('canvas');
        return [...canvas.getContext('2d').getImageData(canvas.width * 0.04, canvas.height * 0.05, 1, 1).data];
      }, `.streams li:nth-child(${name === 'ball' ? 1 : 2})`);
      assert.ok(r > 150 && g < 90, `the picture of ${name} is not its texture: ${r}, ${g}`);
    }
    assert.equal(await page.getAttribute(`${rowOf('ball')} button:text-is("Show")`, 'aria-pressed'), 'true');
    assert.match(await page.textContent(rowOf('other')), /feeder:ball/);
  },

  async 'a second one stands beside the first, with a gap'(page) {
    await page.click(`${rowOf('other')} button:text-is("Beside")`);
    await besides(page, 1);
    assert.match(page.url(), /\?stream=ball,other$/);
    assert.match(await page.textContent('#panel-streams'), /does not say where one rig stands to another/);
    await page.keyboard.press('Escape');
    await feeder.standStill(page, kFrame); // both from here on
    await page.waitForFunction((n) => window.relievo.diagnostics().besides[0].frame === n, kFrame);
    await still(page);
    const { besides: [{ right, extent }] } = await look(page);
    const width = extent.max[0] - extent.min[0];
    assert.ok(right > width && right < 1.4 * width, `${right} m, of a surface ${width} m wide`);
    await assertStands(page, 0);
    await assertStands(page, right);
    assert.equal((await look(page)).besides[0].errors, 0);
  },

  async 'modes are for all of them, the rig\'s camera for its own'(page) {
    const { besides: [{ right }] } = await look(page);
    await page.keyboard.press('6');
    await still(page);
    const [one, other] = [await corners(page, 0), await corners(page, right)];
    for (const i of [0, 1]) for (const c of [0, 1, 2]) assert.ok(Math.abs(one[i][c] - other[i][c]) < 12, `${one}, ${other}`);
    await page.keyboard.press('1');
    await page.keyboard.press('c');
    await still(page);
    const alone = await page.evaluate(() => window.relievo.readPixels());
    const { cameraPicture: { width, height } } = await look(page);
    const { width: across, height: down } = page.viewportSize();
    const share = (width * height) / (across * down); // of the page
    await page.keyboard.press('o');
    await page.keyboard.press('r');
    await still(page);
    assert.ok(share > 0.3 && alone.covered > 0.9 * share && alone.covered < 1.01 * share, `covers ${alone.covered} of ${share}`);
  },

  async 'what is under the cursor is read of whichever stream it is'(page) {
    feeder.say(`apart ${kApart}`); // another shape from here on
    await feeder.standStill(page, kFrame);
    await page.waitForFunction(([n, m]) => {
      const now = window.relievo.diagnostics();
      return now.frame === n && now.besides[0].frame === m;
    }, [kFrame, kFrame + kApart]);
    await still(page);
    for (const [u, v] of [[0.1, 0.15], [0.5, 0.5], [0.85, 0.8]]) {
      for (const name of ['ball', 'other']) {
        const { at, point } = await placeOf(page, name, u, v);
        const picked = await page.evaluate(([x, y]) => window.relievo.pick(x, y), at);
        assert.equal(picked.stream, name);
        for (const i of [0, 1, 2]) near(picked.point[i], point[i], 0.002, `${name}: ${'xyz'[i]} at ${u}, ${v}`);
        await page.mouse.move(...at);
        const said = await page.waitForFunction((of) => new RegExp(`^${of} · depth ([\\d.]+)`).exec(document.querySelector('#cursor')?.textContent)?.[1], name);
        near(Number(await said.jsonValue()), point[2] * 1000, 2, `${name}: depth at ${u}, ${v}`);
      }
    }
    const depths = await Promise.all(['ball', 'other'].map(async (name) => (await placeOf(page, name, 0.5, 0.5)).point[2]));
    assert.ok(Math.abs(depths[0] - depths[1]) > 0.005, `the two shapes are alike: ${depths}`);
  },

  async 'lengths are measured on each, not between rigs that nobody has placed'(page) {
    const clickOn = async (...place) => {
      const { at } = await placeOf(page, ...place);
      assert.equal(await page.evaluate(([x, y]) => document.elementFromPoint(x, y)?.id, at), 'view', `${place} at ${at}`);
      await page.mouse.click(...at);
    };
    for (let i = 0; i < 11; ++i) await page.keyboard.press('-'); // the panel lies over what is at the right
    await page.keyboard.press('m');
    await page.click('#panel-measure .segments button:text-is("Distance")');
    await still(page);
    for (const name of ['other', 'ball']) {
      const [a, b] = [(await placeOf(page, name, 0.15, 0.2)).point, (await placeOf(page, name, 0.5, 0.55)).point];
      const { length } = (await look(page)).measurements;
      await clickOn(name, 0.15, 0.2);
      await clickOn(name, 0.5, 0.55);
      await page.waitForFunction((n) => window.relievo.diagnostics().measurements.length > n, length);
      const m = (await look(page)).measurements.at(-1);
      near(m.value, Math.hypot(...a.map((c, i) => c - b[i])), 0.003, `distance on ${name}`);
      assert.deepEqual(m.spots.map((s) => s.stream), [name, name]);
    }
    await clickOn('ball', 0.15, 0.2);
    await clickOn('other', 0.15, 0.2);
    await page.waitForFunction(() => /of another stream/.test(document.querySelector('#panel-measure')?.textContent));
    assert.equal((await look(page)).measurements.length, 2);
    await clickOn('ball', 0.15, 0.8); // the first place still counts
    await page.waitForFunction(() => window.relievo.diagnostics().measurements.length === 3);
    await page.click('#panel-measure .segments button:text-is("Section")');
    await clickOn('other', 0.15, 0.5);
    await clickOn('other', 0.85, 0.5);
    await page.waitForFunction(() => window.relievo.diagnostics().measurements.length === 4);
    const { profile } = (await look(page)).measurements[3];
    assert.ok(profile.length > 100, `${profile.length} pieces`);
    for (const [{ point: [x, y, z] }] of profile) {
      const [u, v] = [x, y].map((c, i) => (c * kPicture.focal) / ([kPicture.width, kPicture.height][i] * z) + 0.5);
      if (isRim(u, v, kFrame + kApart)) continue;
      near(z, pointOf(u, v, kFrame + kApart)[2], 0.003, `depth of the section at ${u}, ${v}`);
    }
    await page.click('#panel-measure button:text-is("Clear")');
    await page.keyboard.press('Escape');
  },

  async 'a double-click turns around a place of the other one'(page) {
    const { at, point, right } = await placeOf(page, 'other', 0.5, 0.5);
    await page.mouse.dblclick(...at);
    await still(page);
    await page.keyboard.press('ArrowLeft');
    await still(page);
    const middle = await freeMiddle(page);
    const now = await toPage(page, [point[0] + right, point[1], point[2]]);
    near(now.x, middle.x, kJitter_px, 'the pivot, to the right');
    near(now.y, middle.y, kJitter_px, 'the pivot, down');
    await page.keyboard.press('r');
    await still(page);
  },

  async 'the time line is of the one that is chosen'(page) {
    feeder.say('apart 0');
    feeder.say('start ball');
    const other = async () => (await look(page)).besides[0];
    await shownPast(page, (await look(page)).shown + 6);
    const choice = page.getByLabel('Stream that the time line is of');
    assert.deepEqual(await choice.locator('option').allTextContents(), ['ball', 'other']);
    assert.match(await choice.getAttribute('title'), /: ball$/);
    const wide = page.viewportSize();
    await page.setViewportSize({ width: 390, height: 844 });
    const top = async (of) => (await page.locator(`#timeline ${of}`).boundingBox()).y;
    await eventually('its buttons stand in two rows on a phone', async () => {
      const [track, play, back] = [await top('.track'), await top('button[title^="Pause"]'), await top('button[title^="A frame back"]')];
      return play > track && Math.abs(play - back) < 3;
    });
    await page.setViewportSize(wide);
    await choice.selectOption('other');
    await page.click('#timeline button[title^="Pause"]');
    await page.waitForFunction(() => window.relievo.diagnostics().besides[0].following === false);
    const { shown } = await look(page);
    await shownPast(page, shown + 5);
    assert.equal((await look(page)).playback.following, true, 'the first one was stopped too');
    await page.waitForFunction(() => !window.relievo.diagnostics().besides[0].busy); // what was on its way is shown
    const { index, frame } = await other();
    await page.click('#timeline button[title^="A frame back"]');
    await page.waitForFunction((n) => window.relievo.diagnostics().besides[0].index < n, index);
    await page.waitForFunction((n) => window.relievo.diagnostics().besides[0].frame < n, frame);
    await page.click('#follow');
    await page.waitForFunction((n) => window.relievo.diagnostics().besides[0].frame > n + 5, frame);
    assert.equal((await other()).following, true);
    await choice.selectOption('ball');
    await page.click('#timeline button[title^="Pause"]');
    await inState(page, 'shifted');
    assert.equal((await other()).following, true);
    await page.click('#follow');
    await inState(page, 'live');
  },

  async 'in one frame, and taken away'(page) {
    await page.keyboard.press('n');
    await page.selectOption('#panel-streams select', 'together');
    await page.waitForFunction(() => window.relievo.diagnostics().besides[0].right === 0);
    await page.click(`${rowOf('other')} button:text-is("Beside")`);
    await page.waitForFunction(() => window.relievo.diagnostics().besides.length === 0);
    await page.waitForFunction(() => document.querySelector('#timeline .stream').hidden);
    assert.match(page.url(), /\?stream=ball$/);
    await page.close(); // what follows has pages of its own
  },

  async 'an address and a link open both'() {
    feeder.say('start ball');
    const page = await open('/?stream=ball,other');
    await inState(page, 'live');
    await besides(page, 1);
    assert.match(await page.evaluate(() => window.relievo.link()), /\?stream=ball(,|%2C)other#/);
    await page.keyboard.press('n');
    await page.click(`${rowOf('other')} button:text-is("Show")`);
    await page.waitForFunction(() => window.relievo.diagnostics().stream === 'other');
    assert.deepEqual((await look(page)).besides, []);
    await inState(page, 'live');
    await page.close();
  },

  async 'the browser goes back to the streams that were shown before, and on again'() {
    const page = await open('/#mode=shaded');
    const shows = async (name, count) => {
      await page.waitForFunction((of) => window.relievo.diagnostics().stream === of, name);
      await inState(page, 'live');
      await besides(page, count);
    };
    await shows('ball', 0);
    await page.keyboard.press('n');
    await page.click(`${rowOf('other')} button:text-is("Show")`);
    await shows('other', 0);
    assert.match(page.url(), /\?stream=other$/);
    assert.equal(await page.getAttribute('#streams', 'title'), 'other');
    await page.click(`${rowOf('ball')} button:text-is("Beside")`);
    await shows('other', 1);
    await page.goBack();
    await shows('ball', 0);
    assert.match(page.url(), /\?stream=ball#mode=shaded$/);
    await page.evaluate(() => (location.hash = '#mode=depth')); // of what is shown
    await page.waitForFunction(() => window.relievo.diagnostics().mode === 'depth');
    await page.goBack();
    await page.waitForFunction(() => window.relievo.diagnostics().mode === 'shaded');
    await page.selectOption('#streams', 'other');
    await page.selectOption('#streams', 'ball');
    await page.evaluate(() => history.go(-2));
    await page.evaluate(() => history.go(1));
    await shows('other', 0);
    await page.setInputFiles('#file', { name: 'own.ply', mimeType: 'application/octet-stream', buffer: Buffer.from('ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 1\n1 0 1\n0 1 1\n3 0 1 2\n') });
    await page.waitForFunction(() => window.relievo.diagnostics().file === 'own.ply');
    assert.equal(new URL(page.url()).search, '', 'a file of this device is none of the server');
    await page.goBack();
    await shows('other', 0);
    await page.close();
  },

  async 'a stream is placed by what both see, and a link keeps it'() {
    const page = await open('/?stream=ball,other', { viewport: { width: 1200, height: 750 } });
    await besides(page, 1);
    feeder.say(`apart ${kApart}`);
    await feeder.standStill(page, kFrame);
    await page.waitForFunction((n) => window.relievo.diagnostics().besides[0].frame === n, kFrame + kApart);
    await page.keyboard.press('n');
    await page.click(`${rowOf('other')} button:text-is("Place…")`);
    await page.focus('#view');
    for (let i = 0; i < 11; ++i) await page.keyboard.press('-'); // the panel lies over what is at the right
    await still(page);
    const say = '#panel-streams .aligning';
    const asked = (what) => page.waitForFunction(([of, words]) => new RegExp(words).test(document.querySelector(of).textContent), [say, what]);
    const clickOn = async (...place) => page.mouse.click(...(await placeOf(page, ...place)).at);
    await asked('Click a place of ball');
    await clickOn('other', 0.1, 0.1);
    await asked('That is no place of ball');
    const places = [[0.08, 0.1], [0.92, 0.12], [0.1, 0.9], [0.9, 0.88]];
    const pairs = [];
    for (const [i, [u, v]] of places.entries()) {
      pairs.push([(await placeOf(page, 'other', u, v)).point, (await placeOf(page, 'ball', u, v)).point]);
      assert.equal(await page.isDisabled('#panel-streams button:text-is("Put it there")'), i < 3);
      await clickOn('ball', u, v);
      await asked('Click the same place of other');
      await clickOn('other', u, v);
      await asked(i < 2 ? 'Click a place of ball' : `${i + 1} places fit within`);
    }
    const rms = Number(/within ([\d.]+) mm/.exec(await page.textContent(say))[1]) / 1000;
    await page.click('#panel-streams button:text-is("Put it there")');
    await page.waitForFunction((of) => document.querySelector(of).hidden, say);
    const { pose } = (await look(page)).besides[0];
    const off = pairs.map(([from, to]) => Math.hypot(...moved(pose, from).map((c, axis) => c - to[axis])));
    near(Math.sqrt(off.reduce((sum, d) => sum + d * d, 0) / off.length), rms, 0.002, 'what is left, of the true places');
    assert.ok(rms < 0.02, `${rms} m`);
    const link = await page.evaluate(() => window.relievo.link());
    await page.close();

    const again = await open(link.slice(link.indexOf('/', 8)), { viewport: { width: 1200, height: 750 } });
    await besides(again, 1);
    const kept = (await look(again)).besides[0].pose;
    for (const i of kept.rotation.keys()) near(kept.rotation[i], pose.rotation[i], 1e-4, 'its rotation');
    for (const i of [0, 1, 2]) near(kept.translation[i], pose.translation[i], 1e-4, 'its place');
    await again.close();
  },

  async 'a link\'s eye stays where it is when what is beside appears'() {
    const page = await open('/?stream=ball,other#eye=0.6_0.3_0.4&at=0.1_-0.05_-0.9&place=other_0_0_0_1.2_0_0', { viewport: { width: 1200, height: 750 } });
    await besides(page, 1);
    await page.waitForFunction(() => window.relievo.diagnostics().shown > 0);
    await still(page);
    const said = new URLSearchParams(new URL(await page.evaluate(() => window.relievo.link())).hash.slice(1));
    assert.equal(said.get('eye'), '0.6_0.3_0.4');
    assert.equal(said.get('at'), '0.1_-0.05_-0.9');
    await page.keyboard.press('n');
    await page.selectOption('#panel-streams select', 'together'); // what a person does shows all again
    await page.waitForFunction(() => !window.relievo.link().includes('eye=0.6_0.3_0.4'));
    await page.close();
  },

  async 'what is turned is drawn and read where it stands'() {
    const [angle, to] = [-0.6, [1.4, 0.05, 0.1]];
    const page = await open(`/?stream=ball,other#smooth=0&place=other_0_${angle}_0_${to.join('_')}`, { viewport: { width: 1200, height: 750 } });
    await besides(page, 1);
    await page.waitForFunction((n) => window.relievo.diagnostics().besides[0].frame === n, kFrame + kApart);
    await still(page);
    const pose = { rotation: [Math.cos(angle), 0, Math.sin(angle), 0, 1, 0, -Math.sin(angle), 0, Math.cos(angle)], translation: to };
    for (const [u, v] of [[0.15, 0.2], [0.5, 0.5], [0.85, 0.8]]) {
      const point = pointOf(u, v, kFrame + kApart);
      const picked = await pickAt(page, moved(pose, point));
      assert.equal(picked?.stream, 'other', `${u}, ${v}`);
      for (const i of [0, 1, 2]) near(picked.point[i], point[i], 0.002, `${'xyz'[i]} at ${u}, ${v}`);
    }
    const [u, v] = [30 / kPicture.width, 30 / kPicture.height];
    const [r, g, b] = await colourAt(page, moved(pose, pointOf(u, v, kFrame + kApart)));
    assert.ok(r > 150 && g < 90 && b < 90, `no red at its corner: ${[r, g, b]}`);
    await page.close();
  },

  async 'rigs that say where they stand stand there, unless a link says otherwise'() {
    const size = { viewport: { width: 1200, height: 750 } };
    const [first, other] = [[0.3, 0.5, 0.1, 2], [-0.4, 1.6, 0.1, 2.3]];
    for (const [name, said] of [['ball', first], ['other', other]]) feeder.say(`place ${name} ${said.join(' ')}`);
    const rig = ([angle, ...translation]) => ({ rotation: [Math.cos(angle), 0, Math.sin(angle), 0, 1, 0, -Math.sin(angle), 0, Math.cos(angle)], translation });
    const page = await open('/?stream=ball,other#smooth=0', size);
    await besides(page, 1);
    await page.waitForFunction(() => Math.abs(window.relievo.diagnostics().besides[0].pose.rotation[2]) > 0.1);
    await page.waitForFunction((n) => window.relievo.diagnostics().besides[0].frame === n, kFrame + kApart);
    await still(page);
    const { pose } = (await look(page)).besides[0];
    const point = pointOf(0.85, 0.8, kFrame + kApart);
    const [here, there] = [moved(rig(first), moved(pose, point)), moved(rig(other), point)];
    for (const i of [0, 1, 2]) near(here[i], there[i], 1e-6, `${'xyz'[i]} in the frame of both`);
    const picked = await pickAt(page, moved(pose, point));
    assert.equal(picked?.stream, 'other');
    for (const i of [0, 1, 2]) near(picked.point[i], point[i], 0.002, `${'xyz'[i]} of what is picked`);
    await page.keyboard.press('n');
    await page.waitForFunction(() => /Each stands where its rig, or a person, says/.test(document.querySelector('#panel-streams')?.textContent));
    assert.doesNotMatch(await page.evaluate(() => window.relievo.link()), /place=/);
    await page.keyboard.press('Escape');

    // A length from one to the other is that between the rigs' places.
    const { frame } = await look(page);
    const ends = [['ball', pointOf(0.1, 0.2, frame), kNowhere], ['other', pointOf(0.85, 0.8, kFrame + kApart), pose]];
    const clickBoth = async (of) => {
      for (let i = 0; i < 11; ++i) await of.keyboard.press('-'); // the panel lies over what is at the right
      await of.keyboard.press('m');
      await of.click('#panel-measure .segments button:text-is("Distance")');
      await still(of);
      for (const [name, from, its] of ends) {
        const place = await restingPlace(of, moved(name === 'other' ? (await look(of)).besides[0].pose : its, from));
        assert.equal(await of.evaluate(([px, py]) => window.relievo.pick(px, py)?.stream, [place.x, place.y]), name);
        await of.mouse.click(place.x, place.y);
      }
    };
    await clickBoth(page);
    await page.waitForFunction(() => window.relievo.diagnostics().measurements.length === 1);
    const [{ value, spots }] = (await look(page)).measurements;
    assert.deepEqual(spots.map((s) => s.stream), ['ball', 'other']);
    const [a, b] = [moved(rig(first), ends[0][1]), moved(rig(other), ends[1][1])];
    near(value, Math.hypot(...a.map((c, i) => c - b[i])), 0.004, 'from one rig to the other');
    await page.close();
    const linked = await open('/?stream=ball,other#place=other_0_0_0_1.2_0_0', size);
    await besides(linked, 1);
    assert.deepEqual((await look(linked)).besides[0].pose, { ...kNowhere, translation: [1.2, 0, 0] });
    // A person's hand is too inexact for that, in one frame with others too.
    await linked.keyboard.press('n');
    await linked.selectOption('#panel-streams select', 'together');
    await linked.keyboard.press('Escape');
    await clickBoth(linked);
    await linked.waitForFunction(() => /of another stream/.test(document.querySelector('#panel-measure')?.textContent));
    assert.deepEqual((await look(linked)).measurements, []);
    await linked.close();
  },

  async 'one beside the first that is gone is dimmed and named, and can be taken away'() {
    const page = await open('/?stream=other,ball', { viewport: { width: 1200, height: 750 } });
    await besides(page, 1);
    await still(page);
    const redOf = async () => {
      const [{ frame, pose }] = (await look(page)).besides;
      return (await colourAt(page, moved(pose, pointOf(30 / kPicture.width, 30 / kPicture.height, frame))))[0];
    };
    const before = await redOf();
    feeder.say('gone');
    await page.waitForFunction(() => window.relievo.diagnostics().besides[0].word === 'Ended');
    await still(page);
    near((await redOf()) / before, 0.34, 0.05, 'how much is left of its red');
    await page.waitForFunction(() => /ball · Ended/.test(document.querySelector('#source')?.textContent));
    await page.keyboard.press('n');
    await page.waitForSelector(`${rowOf('ball')} small:text-is("gone")`);
    await page.click(`${rowOf('ball')} button:text-is("Beside")[aria-pressed="true"]`);
    await page.waitForFunction(() => window.relievo.diagnostics().besides.length === 0);
    await page.waitForFunction(() => document.querySelectorAll('.streams li b').length === 1);
    await page.close();
    feeder.say('start ball');
  },

  async 'one that never was is named, and the choice of a time line stays'() {
    const page = await open('/?stream=ball,nobody', { viewport: { width: 1200, height: 750 } });
    await shownPast(page, 3);
    await page.waitForFunction(() => /nobody · Waiting/.test(document.querySelector('#source')?.textContent));
    const choice = page.getByLabel('Stream that the time line is of');
    await choice.locator('option:text-is("nobody · Waiting")').waitFor({ state: 'attached' });
    assert.deepEqual(await choice.locator('option').allTextContents(), ['ball', 'nobody · Waiting']);
    await choice.selectOption('nobody');
    await page.waitForSelector('#timeline.empty');
    assert.equal(await page.isVisible('#timeline input[type=range]'), false);
    await choice.selectOption('ball');
    await page.waitForSelector('#timeline input[type=range]', { state: 'visible' });
    await page.close();
  },

  async 'of a long list only those in sight are read for their pictures'() {
    const page = await open('/', {});
    await shownPast(page, 2);
    await page.route('**/api/streams', async (route) => {
      const listed = await (await route.fetch()).json();
      for (let i = 0; i < 40; ++i) listed.streams.push({ ...listed.streams[0], name: `more-${i}` });
      await route.fulfill({ json: listed });
    });
    const asked = []; // none of the others has frames, so that each takes some seconds
    page.on('websocket', (socket) => asked.push(new URL(socket.url()).pathname));
    await page.keyboard.press('n');
    await eventually('no picture of the others is asked for', () => asked.includes('/ws/more-0'));
    await page.evaluate(() => document.querySelector('.streams li:last-child').scrollIntoView());
    const before = asked.length;
    await eventually('the last are not asked for', () => asked.includes('/ws/more-39'));
    const between = asked.slice(before).filter((path) => /more-/.test(path)).map((path) => Number(/\d+$/.exec(path)));
    assert.ok(between.filter((i) => i < 20).length <= 1, `asked for ${between}`); // which was the next
    await page.unrouteAll({ behavior: 'ignoreErrors' });
    await page.close();
  },

  async 'no error, no request to another host'() {
    // Chromium tells of what the server refuses: that it has no folder of recordings.
    assert.deepEqual(complaints.filter((c) => !/status of 404/.test(c)), []);
  },
};

let failed = 1;
try {
  feeder.say('start ball');
  feeder.say('also other');
  failed = await runChecks(checks, await open('/?stream=ball', { viewport: { width: 1200, height: 750 } }));
} finally {
  await browser.close();
  await feeder.kill();
}
process.exit(failed === 0 ? 0 : 1);
