// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium and against the feeder's known surface: how a person moves with mouse, keys and fingers,
// around a pivot or flying, and how wide they see.
// Run as: node move_test.mjs GATEWAY_FEEDER, in web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { launchChromium } from './chromium.mjs';
import { Feeder, freeMiddle, kJitter_px, kPicture, kPlaces, look, pagesOf, pickAt, pointOf, press, restingPlace, runChecks, shownPast, still, toPage } from './feeder.mjs';

const kPage = { width: 800, height: 500 };
const kFrame = 62; // the ball is in the middle, its rim at none of kPlaces, and none of them behind it

const feeder = await Feeder.start(process.argv[2]);
const browser = await launchChromium();
const complaints = [];
const { open } = pagesOf(browser, `http://127.0.0.1:${feeder.port}`, complaints);
const near = (a, b, within, what) => assert.ok(Math.abs(a - b) <= within, `${what}: ${a}, not ${b}`);
const unit = (a) => a.map((c) => c / Math.hypot(...a));
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

const checks = {
  async 'a drag leaves the camera, and what is picked is where it is drawn'(page) {
    await shownPast(page, 2);
    await feeder.standStill(page, kFrame); // this surface from here on
    await still(page);
    await press(page, 'c');
    await page.mouse.move(400, 250);
    await page.mouse.down();
    await page.mouse.move(460, 280, { steps: 4 });
    await page.mouse.up();
    await still(page);
    const { way, frame } = await look(page);
    assert.equal(way, 'orbit');
    for (const [u, v] of kPlaces) {
      const point = pointOf(u, v, frame);
      const picked = await pickAt(page, point);
      for (const i of [0, 1, 2]) near(picked.point[i], point[i], 0.002, `${'xyz'[i]} at ${u}, ${v}`);
    }
  },

  async 'a double-click sets the pivot, which then stays in the middle'(page) {
    const { frame } = await look(page);
    const pivot = pointOf(0.4, 0.4, frame);
    const at = await restingPlace(page, pivot);
    assert.equal(await page.evaluate(({ x, y }) => document.elementFromPoint(x, y).id, at), 'view');
    await page.mouse.dblclick(at.x, at.y);
    await still(page);
    const middle = await freeMiddle(page);
    let first = null;
    for (const key of [null, 'ArrowLeft', 'ArrowUp']) {
      if (key !== null) await press(page, key);
      const now = await toPage(page, pivot);
      near(now.x, middle.x, kJitter_px, 'pivot x');
      near(now.y, middle.y, kJitter_px, 'pivot y');
      first ??= now;
      near(now.x, first.x, 2, 'pivot x, turned');
      near(now.y, first.y, 2, 'pivot y, turned');
    }
  },

  async 'what is dragged aside stays under the cursor, and nothing turns'(page) {
    const { frame } = await look(page);
    const point = pointOf(0.4, 0.4, frame); // the pivot's distance: what is dragged follows the cursor there
    for (const [button, key] of [['right', null], ['left', 'Shift']]) {
      const [from, before] = [await toPage(page, point), await page.evaluate(() => window.relievo.pose())];
      if (key !== null) await page.keyboard.down(key);
      await page.mouse.move(from.x, from.y);
      await page.mouse.down({ button });
      await page.mouse.move(from.x + 50, from.y - 30, { steps: 5 });
      await page.mouse.up({ button });
      if (key !== null) await page.keyboard.up(key);
      await still(page);
      const [to, after] = [await toPage(page, point), await page.evaluate(() => window.relievo.pose())];
      near(to.x - from.x, 50, 3, `to the right by the ${button} button`);
      near(to.y - from.y, -30, 3, `up by the ${button} button`);
      const gaze = ({ position, target }) => target.map((t, i) => t - position[i]);
      for (const i of [0, 1, 2]) near(gaze(after)[i], gaze(before)[i], 1e-6, 'where it looks');
    }
    await press(page, 'r');
  },

  async 'an open panel moves the middle aside, and nothing else'(page) {
    const { frame } = await look(page);
    const pivot = pointOf(0.4, 0.4, frame);
    const at = await restingPlace(page, pivot);
    await page.mouse.dblclick(at.x, at.y);
    await still(page);
    const before = { pose: await page.evaluate(() => window.relievo.pose()), at: await toPage(page, pivot) };
    for (const key of ['i', 'm', 't']) {
      await press(page, key);
      const [now, middle] = [await toPage(page, pivot), await freeMiddle(page)];
      near(now.x, middle.x, kJitter_px, `pivot x with the panel of ${key}`);
      assert.ok(now.x < before.at.x - 100, `${now.x} is where it was`);
      assert.deepEqual(await page.evaluate(() => window.relievo.pose()), before.pose);
      for (const [u, v] of kPlaces) {
        const point = pointOf(u, v, frame);
        const picked = await pickAt(page, point);
        for (const i of [0, 1, 2]) near(picked.point[i], point[i], 0.002, `${'xyz'[i]} at ${u}, ${v}`);
      }
    }
    await press(page, 'Escape');
    near((await toPage(page, pivot)).x, before.at.x, 1e-6, 'pivot x when it is closed again');
    await press(page, 'c');
    const { cameraPicture: whole } = await look(page);
    await press(page, 'm');
    const { cameraPicture: picture } = await look(page);
    const panel = await page.evaluate(() => document.querySelector('#panel-measure').getBoundingClientRect().left);
    assert.ok(whole.x + whole.width > panel && picture.x >= 0 && picture.x + picture.width <= panel, JSON.stringify([whole, picture, panel]));
    for (const [u, v] of kPlaces) {
      const at = await toPage(page, pointOf(u, v, frame));
      near(at.x, picture.x + u * picture.width, 1e-3, `x of ${u}, ${v} in the rig's camera's picture`);
      near(at.y, picture.y + v * picture.height, 1e-3, `y of ${u}, ${v} in the rig's camera's picture`);
    }
    await press(page, 'Escape');
    await press(page, 'o');
    await press(page, 'r');
    await page.setViewportSize({ width: 390, height: 780 });
    await still(page);
    const onPhone = await toPage(page, pivot);
    await press(page, 'm');
    near((await toPage(page, pivot)).x, onPhone.x, 1e-6, 'pivot x under a sheet over all of the width');
    await press(page, 'Escape');
    await page.setViewportSize(kPage);
    await press(page, 'r');
  },

  async 'the field of view is the one that was chosen'(page) {
    const half = kPage.height / 2;
    const shown = async () => {
      // Two places as far away as each other, along the page's height: how far apart they are says the angle.
      const { position, target } = await page.evaluate(() => window.relievo.pose());
      const back = unit(position.map((c, i) => c - target[i]));
      const up = cross(back, unit(cross([0, 1, 0], back)));
      const far = Math.hypot(...position.map((c, i) => c - target[i]));
      const place = (share) => target.map((c, i) => (c + share * far * up[i]) * (i === 0 ? 1 : -1));
      const [low, high] = [await toPage(page, place(-0.1)), await toPage(page, place(0.1))];
      return (2 * Math.atan((half * 0.2) / Math.hypot(high.x - low.x, high.y - low.y)) * 180) / Math.PI;
    };
    near(await shown(), (2 * Math.atan(kPicture.height / 2 / kPicture.focal) * 180) / Math.PI, 0.05, "the rig camera's");
    await press(page, 'b');
    const slider = page.getByRole('slider', { name: 'Field of view' });
    for (const degrees of [25, 70]) {
      await slider.fill(String(degrees));
      await still(page);
      near(await shown(), degrees, 0.05, 'degrees');
      assert.match(await page.textContent('#panel-display'), new RegExp(`Field of view${degrees}°`));
    }
    await slider.fill(await slider.getAttribute('min'));
    await press(page, 'Escape');
  },

  async 'flying moves ahead and looks around'(page) {
    await press(page, 'y');
    const before = await page.evaluate(() => window.relievo.pose());
    await page.keyboard.down('w');
    // With each drawing, however few there are of them.
    await page.waitForFunction((from) => Math.hypot(...window.relievo.pose().position.map((p, i) => p - from[i])) > 0.1, before.position);
    await page.keyboard.up('w');
    await still(page);
    const ahead = await page.evaluate(() => window.relievo.pose());
    const gaze = before.target.map((t, i) => t - before.position[i]);
    const moved = ahead.position.map((p, i) => p - before.position[i]);
    const along = moved.reduce((sum, m, i) => sum + m * gaze[i], 0) / (Math.hypot(...moved) * Math.hypot(...gaze));
    assert.ok(along > 0.99, `W moved by ${moved}, looking along ${gaze}`);
    await page.mouse.move(400, 250);
    await page.mouse.down();
    await page.mouse.move(440, 250, { steps: 4 });
    await page.mouse.up();
    await still(page);
    const looked = await page.evaluate(() => window.relievo.pose());
    for (const i of [0, 1, 2]) near(looked.position[i], ahead.position[i], 1e-6, 'the place while looking around');
    assert.ok(Math.hypot(...looked.target.map((t, i) => t - ahead.target[i])) > 0.01, 'looking around did nothing');
    await press(page, 'o');
    await press(page, 'r');
  },

  async 'fingers turn, zoom, move, and set the pivot'() {
    const page = await open('/', { hasTouch: true });
    feeder.say('start ball');
    await shownPast(page, 2);
    await feeder.standStill(page, kFrame);
    await still(page);
    const client = await page.context().newCDPSession(page);
    const touch = (type, ...points) =>
      client.send('Input.dispatchTouchEvent', { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
    const pose = () => page.evaluate(() => window.relievo.pose());
    const distance = ({ position, target }) => Math.hypot(...position.map((p, i) => p - target[i]));
    const first = await pose();
    await touch('touchStart', [400, 250]);
    for (let i = 1; i <= 5; ++i) await touch('touchMove', [400 + i * 14, 250]);
    await touch('touchEnd');
    await still(page);
    const turned = await pose();
    assert.ok(Math.abs(turned.position[0] - first.position[0]) > 0.05, 'one finger does not turn');
    near(distance(turned), distance(first), 1e-4, 'distance after turning');
    await touch('touchStart', [380, 250], [420, 250]);
    for (let i = 1; i <= 5; ++i) await touch('touchMove', [380 - i * 12, 250], [420 + i * 12, 250]);
    await touch('touchEnd');
    await still(page);
    assert.ok(distance(await pose()) < 0.8 * distance(first), 'spreading two fingers does not zoom');
    const closer = await pose();
    await touch('touchStart', [380, 250], [420, 250]);
    for (let i = 1; i <= 5; ++i) await touch('touchMove', [380 + i * 10, 250], [420 + i * 10, 250]);
    await touch('touchEnd');
    await still(page);
    const aside = await pose();
    assert.ok(aside.target[0] < closer.target[0] - 0.01, `two fingers do not move it: ${closer.target}, then ${aside.target}`);
    near(distance(aside), distance(closer), 0.02 * distance(closer), 'distance after moving');
    await page.keyboard.press('r');
    await still(page);
    const { frame } = await look(page);
    const pivot = pointOf(0.4, 0.4, frame);
    const at = await restingPlace(page, pivot);
    // All four at once: where each waits for the page's answer, two taps on a loaded machine are too far apart in time.
    const tap = [['touchStart', [at.x, at.y]], ['touchEnd']];
    await Promise.all([...tap, ...tap].map(([type, ...points]) => touch(type, ...points)));
    await still(page);
    const [middle, now] = [await freeMiddle(page), await toPage(page, pivot)];
    near(now.x, middle.x, kJitter_px, 'what was tapped twice, to the right');
    near(now.y, middle.y, kJitter_px, 'what was tapped twice, down');
    await page.close();
  },

  async 'no error, no request to another host'() {
    assert.deepEqual(complaints, []);
  },
};

let failed = 1;
try {
  feeder.say('start ball');
  failed = await runChecks(checks, await open());
} finally {
  await browser.close();
  await feeder.kill();
}
process.exit(failed === 0 ? 0 : 1);
