// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium and against the feeder's known surface: the rig camera's view, colours that stand for
// numbers, what is under the cursor, what is remembered, what the page weighs.
// Run as: node see_test.mjs GATEWAY_FEEDER, in web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { eventually, launchChromium } from './chromium.mjs';
import { colourAt, depthOf, Feeder, inState, kPicture, kPlaces, look, pagesOf, pick, pointOf, press, runChecks, shownPast, still, toPage } from './feeder.mjs';
import { loadsOf } from './web.mjs';

const kPage = { width: 800, height: 500 };
const kFirstPictureBytes = 300_000; // gzipped
const kSlow_ms = 9000; // far longer than the page waits where no picture comes
const kContrast = 4.5; // WCAG AA

const feeder = await Feeder.start(process.argv[2]);
const origin = `http://127.0.0.1:${feeder.port}`;
const browser = await launchChromium();
const complaints = [];
const { newPage, open } = pagesOf(browser, origin, complaints);

let picture; // of the camera, where it is on the page
/** Where a pixel of it (its upper left corner) is on the page in the rig camera's view. */
const onPage = (column, row) => ({
  x: picture.x + (column / kPicture.width) * picture.width,
  y: picture.y + (row / kPicture.height) * picture.height,
});
/** Where it is, and the sides of what nothing lies over: of one moment, as a line more below moves both, one after the other. */
const pictureAndFree = (page) =>
  page.evaluate(() => {
    const of = (selector) => document.querySelector(selector).getBoundingClientRect();
    const panel = [...document.querySelectorAll('#panels aside:not([hidden])')].map((e) => e.getBoundingClientRect()).find(({ width }) => width > 0);
    const free = { top: of('header').bottom, bottom: of('footer').top, right: Math.min(of('#rail').left, panel?.left ?? Infinity) };
    return [window.relievo.diagnostics().cameraPicture, free];
  });
/** It is whole where nothing lies over the page. */
const placed = async (page) => {
  let found;
  await eventually(() => `it is not whole: ${JSON.stringify(found)}`, async () => {
    found = await pictureAndFree(page);
    const [{ x, y, width, height }, { top, bottom, right }] = found;
    return x >= -0.01 && y >= top - 2 && x + width <= right + 2 && y + height <= bottom + 2;
  });
  [picture] = found;
  near(picture.width / picture.height, kPicture.width / kPicture.height, 1e-6, 'its sides');
};
const pixel = (page, { x, y }) => page.evaluate(([px, py]) => window.relievo.pixelAt(px, py), [x, y]);
const near = (a, b, within, what) => assert.ok(Math.abs(a - b) <= within, `${what}: ${a}, not ${b}`);
/** Of the feeder: the ball is in the middle, its rim at none of kPlaces, and none of them behind it. */
const kFrame = 62;

/** Towards the camera, in three's frame (y up, z to the viewer). */
function normalOf(u, v, frame) {
  const [p, right, down] = [pointOf(u, v, frame), pointOf(u + 0.01, v, frame), pointOf(u, v + 0.01, frame)];
  const [a, b] = [right.map((c, i) => c - p[i]), down.map((c, i) => c - p[i])];
  const n = [a[2] * b[1] - a[1] * b[2], a[0] * b[2] - a[2] * b[0], a[1] * b[0] - a[0] * b[1]];
  const size = Math.hypot(...n);
  return [n[0] / size, -n[1] / size, -n[2] / size];
}
const dot = (a, b) => a.reduce((sum, c, i) => sum + c * b[i], 0);
const unit = (a) => a.map((c) => c / Math.hypot(...a));
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const linear = (c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4);
const mean = (values) => values.reduce((sum, v) => sum + v, 0) / values.length;

const checks = {
  async 'what comes before the first picture is small, on a slow link too'() {
    feeder.say('start ball');
    for (const late_ms of [0, kSlow_ms]) {
      const page = await newPage();
      await page.route(/draco_decoder/, (route) => setTimeout(() => void route.continue().catch(() => undefined), late_ms));
      const loads = loadsOf(page);
      await page.goto(`${origin}/`);
      await shownPast(page, 1);
      const bytes = [...(await loads()).values()].reduce((sum, of) => sum + of, 0);
      console.log(`      ${bytes} bytes gzipped to the first picture`);
      assert.ok(bytes > 50_000 && bytes < kFirstPictureBytes, `${bytes} bytes`);
      await page.close();
    }
  },

  async "the rig camera's view shows the picture where the camera saw it"(page) {
    await shownPast(page, 2);
    await feeder.standStill(page, kFrame); // this surface from here on
    await still(page);
    await press(page, 'c');
    assert.equal((await look(page)).way, 'camera');
    await placed(page);
    const isRed = ([r, g, b]) => r > 180 && g < 90 && b < 90;
    const isGreen = ([r, g, b]) => r < 90 && g > 150 && b < 90;
    for (const at of [[4, 30], [57, 30], [30, 4], [30, 57]]) {
      assert.ok(isRed(await pixel(page, onPage(...at))), `no red at ${at}`);
      assert.ok(isGreen(await pixel(page, onPage(kPicture.width - at[0], at[1]))), `no green opposite ${at}`);
    }
    for (const at of [[63, 30], [30, 63]]) {
      assert.ok(!isRed(await pixel(page, onPage(...at))), `red at ${at}`);
      assert.ok(!isGreen(await pixel(page, onPage(kPicture.width - at[0], at[1]))), `green opposite ${at}`);
    }
    assert.equal((await pixel(page, onPage(-3, 200)))[3], 0, 'something is drawn beside the picture');
  },

  async "the depth under the cursor is the surface's"(page) {
    await placed(page);
    const { frame } = await look(page);
    for (const [u, v] of kPlaces) {
      const picked = await pick(page, onPage(u * kPicture.width, v * kPicture.height));
      near(picked.point[2], depthOf(u, v, frame), 0.0006, `depth at ${u}, ${v}`);
    }
    assert.equal(await pick(page, onPage(-5, 100)), null);
  },

  async 'a line more below does not cover the picture of the rig camera'(page) {
    const lines = (height) =>
      page.evaluate(async (h) => {
        document.querySelector('#statistics').style.paddingBottom = h;
        for (let i = 0; i < 3; ++i) await new Promise((resolve) => requestAnimationFrame(() => setTimeout(resolve))); // observers, and a drawing
      }, height);
    for (const height of ['21px', '']) {
      await lines(height);
      await still(page);
      await placed(page);
    }
  },

  async 'depth has the colour that the legend says'(page) {
    await placed(page);
    await press(page, '6');
    const { frame, depthRange } = await look(page);
    const legend = await page.evaluate(() => {
      const canvas = document.querySelector('#legend canvas');
      return [...canvas.getContext('2d').getImageData(0, 0, 1, canvas.height).data];
    });
    const rows = legend.length / 4;
    const depthOfColour = (rgb) => {
      const away = (row) => rgb.slice(0, 3).reduce((sum, c, i) => sum + (c - legend[row * 4 + i]) ** 2, 0);
      const row = [...Array(rows).keys()].reduce((best, r) => (away(r) < away(best) ? r : best), 0);
      assert.ok(away(row) < 30, `${rgb} is not in the legend`);
      return depthRange.from + ((depthRange.to - depthRange.from) * row) / (rows - 1);
    };
    for (const [u, v] of kPlaces) {
      const rgb = await pixel(page, onPage(u * kPicture.width, v * kPicture.height));
      const z = Math.min(depthRange.to, Math.max(depthRange.from, depthOf(u, v, frame)));
      near(depthOfColour(rgb), z, 0.015 * (depthRange.to - depthRange.from), `depth at ${u}, ${v}`);
    }
    assert.match(await page.textContent('#legend'), /Depth, m/);
  },

  async 'normals have the colour of their direction'(page) {
    await placed(page);
    await press(page, '5');
    const { frame } = await look(page);
    for (const [u, v] of kPlaces) {
      const [r, g, bl] = await pixel(page, onPage(u * kPicture.width, v * kPicture.height));
      const told = [r, g, bl].map((c) => (c / 255) * 2 - 1); // right, up, to the camera
      const truth = normalOf(u, v, frame);
      const cosine = dot(unit(told), truth);
      assert.ok(cosine > 0.985, `${told}, not ${truth} at ${u}, ${v}`);
    }
    assert.ok(await page.isVisible('#legend .disc'));
  },

  async 'confidence has the colour that the legend says'(page) {
    const kSigmas = [64e-6, 362e-6, 1448e-6, 0]; // of what the format's steps are; in bands
    await press(page, '1');
    feeder.say(`sigmas ${kSigmas.join(' ')}`);
    await feeder.standStill(page, kFrame + 1);
    await press(page, '7'); // no frame comes from here on
    const legend = await page.evaluate(() => {
      const canvas = document.querySelector('#legend canvas');
      const marks = [...document.querySelectorAll('#legend li')].map((li) => [li.textContent, parseFloat(li.style.getPropertyValue('--at')) / 100]);
      return { rgba: [...canvas.getContext('2d').getImageData(0, 0, 1, canvas.height).data], marks, unknown: getComputedStyle(document.querySelector('#legend i')).backgroundColor };
    });
    await placed(page);
    const sigmaOf = (name) => parseFloat(name) * (/µm/.test(name) ? 1e-6 : 1e-3);
    const [[least, top], [most, bottom]] = [legend.marks[0], legend.marks.at(-1)].map(([name, share]) => [sigmaOf(name), share]);
    const expected = (sigma) => {
      if (sigma === 0) return legend.unknown.match(/\d+/g).map(Number);
      const share = top + ((bottom - top) * Math.log(sigma / least)) / Math.log(most / least);
      const row = Math.round(share * (legend.rgba.length / 4 - 1));
      return legend.rgba.slice(row * 4, row * 4 + 3);
    };
    for (const [band, sigma] of kSigmas.entries()) {
      const u = (band + 0.5) / kSigmas.length;
      for (const [v, light] of [[0.15, 1], [0.9, 0.6]]) {
        const rgb = await pixel(page, onPage(u * kPicture.width, v * kPicture.height));
        for (const [c, wanted] of expected(sigma).entries()) near(linear(rgb[c]), linear(wanted) * light, 0.04, `${sigma} m at ${u}, ${v}: ${'rgb'[c]} of ${rgb}`);
      }
    }
    feeder.say('sigmas');
    await feeder.standStill(page, kFrame);
  },

  async 'on a phone the legend is a strip beside the tools, and its marks have room'(page) {
    const before = page.viewportSize();
    await page.setViewportSize({ width: 360, height: 740 });
    for (const mode of ['5', '6', '7']) {
      await press(page, mode);
      const { legend, rail, marks } = await page.evaluate(() => {
        const box = (element) => element.getBoundingClientRect().toJSON();
        const marks = [...document.querySelectorAll('#legend li')].map(box).filter(({ width }) => width > 0);
        return { legend: box(document.querySelector('#legend')), rail: box(document.querySelector('#rail')), marks };
      });
      assert.ok(legend.height > 20 && legend.height < 90, `mode ${mode}: ${legend.height} px high`);
      assert.ok(legend.right < rail.left, `mode ${mode}: over the tools`);
      for (const [k, mark] of marks.entries()) {
        assert.ok(mark.left >= legend.left && mark.right <= legend.right && mark.bottom <= legend.bottom, `mode ${mode}: a mark is outside`);
        assert.ok(k === 0 || mark.left > marks[k - 1].right, `mode ${mode}: marks ${k - 1} and ${k} run into each other`);
      }
      assert.ok(mode === '5' || marks.length >= 4, `mode ${mode}: ${marks.length} marks`);
    }
    await page.setViewportSize(before);
  },

  async "light falls on relief as its normals say, from over the viewer's shoulder"(page) {
    const kLight = unit([-0.9, 1.1, 1.6]); // in the frame of who looks
    await press(page, '2');
    const { frame } = await look(page);
    const seen = [];
    await press(page, 'o');
    for (const keys of [[], ['ArrowLeft', 'ArrowLeft', 'ArrowLeft'], ['ArrowUp', 'ArrowUp', 'ArrowUp', 'ArrowRight', 'ArrowRight']]) {
      for (const key of keys) await page.keyboard.press(key);
      await still(page);
      const { position, target } = await page.evaluate(() => window.relievo.pose());
      const back = unit(position.map((c, i) => c - target[i]));
      const right = unit(cross([0, 1, 0], back));
      const up = cross(back, right);
      const light = [0, 1, 2].map((i) => kLight[0] * right[i] + kLight[1] * up[i] + kLight[2] * back[i]);
      for (const [u, v] of [...kPlaces, [0.45, 0.4], [0.55, 0.6], [0.6, 0.5], [0.5, 0.35]]) {
        const normal = normalOf(u, v, frame);
        const [r, g, b] = await colourAt(page, pointOf(u, v, frame));
        seen.push({ told: mean([r, g, b].map(linear)), cosine: dot(normal, light), sky: normal[1] });
      }
    }
    const spread = Math.max(...seen.map((s) => s.cosine)) - Math.min(...seen.map((s) => s.cosine));
    assert.ok(spread > 0.4, `the places are lit alike: ${spread}`);
    const truth = seen.map(({ cosine, sky }) => 2 * Math.max(0, cosine) + 0.5 * sky * 0.6);
    const off = (values) => values.map((v) => v - mean(values));
    const agreement = dot(unit(off(seen.map((s) => s.told))), unit(off(truth)));
    console.log(`      light as the normals say: correlation ${agreement.toFixed(3)}, cosines over ${spread.toFixed(2)}`);
    assert.ok(agreement > 0.95, JSON.stringify(seen));
    await press(page, 'c');
  },

  async 'floor and axes stand in metres'() {
    const page = await open('/'); // its ranges are of this surface alone
    await eventually('no surface is shown', async () => {
      feeder.say(`frame ${kFrame}`);
      return page.evaluate((n) => window.relievo.diagnostics().frame === n, kFrame);
    });
    for (let i = 0; i < 4; ++i) await page.keyboard.press('-');
    await still(page);
    near((await look(page)).gridStep, 0.1, 1e-9, 'metres a square');
    const { min, max } = await page.evaluate(() => window.relievo.extent());
    // Axes are of whole steps around the surface, of which there are 5 to 10; their corner is at its lower left, far side.
    const ends = [0, 1, 2].map((axis) => {
      const step = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5].find((s) => (max[axis] - min[axis]) / s <= 10);
      return [Math.floor(min[axis] / step) * step, Math.ceil(max[axis] / step) * step];
    });
    const lit = async (point) => {
      const { x, y } = await toPage(page, point);
      // A line is a pixel wide, and its place not the middle of one.
      const around = [];
      for (const dx of [-1, 0, 1]) for (const dy of [-1, 0, 1]) around.push(await pixel(page, { x: x + dx, y: y + dy }));
      return around.reduce((best, rgba) => (rgba[3] > best[3] ? rgba : best));
    };
    const corner = [ends[0][0], ends[1][1], ends[2][1]];
    const along = (axis, share) => corner.map((c, i) => (i === axis ? c + share * (ends[i][axis === 0 ? 1 : 0] - c) : c));
    for (const [axis, name] of ['x', 'y', 'z'].entries()) {
      const seen = [];
      for (const share of [0.02, 0.97, 0.99]) seen.push(await lit(along(axis, share)));
      // Red to the right, green up, blue away; the surface may stand before a part of one.
      const own = ([r, g, b, a]) => a > 40 && [r, g, b][axis] === Math.max(r, g, b);
      assert.ok(seen.filter(own).length >= 2, `the ${name} axis: ${JSON.stringify(seen)}`);
    }
    const behind = await lit(along(0, -0.02));
    assert.equal(behind[3], 0, `it goes on behind its end: ${behind}`);
    await press(page, 'g');
    assert.equal((await lit(along(0, 0.02)))[3], 0, 'an axis that was switched off');
    await page.evaluate(() => localStorage.clear());
    await page.close();
  },

  async 'what is said of a stalled stream covers no control'(page) {
    await page.setViewportSize({ width: 700, height: 500 }); // the footer's parts stand above each other
    await inState(page, 'stalled');
    await eventually('the message stands over the time line', () =>
      page.evaluate(() => {
        const bottom = document.querySelector('#card').getBoundingClientRect().bottom;
        return bottom > 0 && bottom < document.querySelector('#timeline').getBoundingClientRect().top;
      }),
    );
    await page.setViewportSize({ width: kPage.width, height: kPage.height });
    await still(page);
  },

  async "the camera's picture stands beside the surface"(page) {
    await press(page, 'r'); // not moved by hand: a new size sets the view anew
    await press(page, 'c');
    await press(page, 'v');
    assert.equal((await look(page)).way, 'camera', 'splitting the page has left the camera');
    const corner = await page.evaluate(() => {
      const canvas = document.querySelector('#picture');
      return [canvas.width, canvas.height, ...canvas.getContext('2d').getImageData(30, 30, 1, 1).data];
    });
    assert.deepEqual(corner.slice(0, 2), [kPicture.width, kPicture.height]);
    assert.ok(corner[2] > 180 && corner[3] < 90, `${corner} is not the picture's red corner`);
    const covers = await page.evaluate(() => document.querySelector('#picture').getBoundingClientRect().left < document.querySelector('#view').getBoundingClientRect().width - 1);
    assert.ok(!covers, 'the picture covers the surface');
    for (let i = 0; i < 3; ++i) await press(page, 'v'); // the stripes, both, none
    await press(page, 'o');
    const ids = await page.evaluate(() => [...document.querySelectorAll('[id]')].map((e) => e.id));
    assert.equal(new Set(ids).size, ids.length, `an id twice: ${ids}`);
  },

  async 'what was chosen is remembered'(page) {
    await page.keyboard.press('6');
    await page.keyboard.press('g');
    await page.keyboard.press('b');
    await page.selectOption('#panel-display select >> nth=0', 'white');
    assert.equal((await look(page)).gridStep, null);
    feeder.say('start ball');
    await page.reload();
    await inState(page, 'live');
    await shownPast(page, 1); // without a surface there is no grid
    const now = await look(page);
    assert.equal(now.mode, 'depth');
    assert.equal(now.gridStep, null);
    assert.equal(await page.evaluate(() => getComputedStyle(document.body).backgroundColor), 'rgb(255, 255, 255)');
    await page.keyboard.press('g');
    await page.waitForFunction(() => window.relievo.diagnostics().gridStep === 0.1);
    await page.evaluate(() => localStorage.clear());
  },

  async 'words can be read in both themes'() {
    for (const colorScheme of ['dark', 'light']) {
      const page = await open('/', { colorScheme });
      await inState(page, 'live');
      const contrasts = await page.evaluate(() => {
        const style = getComputedStyle(document.documentElement);
        const rgb = (name) => {
          const probe = document.createElement('i');
          probe.style.color = style.getPropertyValue(name);
          document.body.append(probe);
          const parts = getComputedStyle(probe).color.match(/[\d.]+/g).slice(0, 3).map(Number);
          probe.remove();
          return parts;
        };
        const luminance = (c) => {
          const [r, g, b] = c.map((v) => (v / 255 <= 0.04045 ? v / 255 / 12.92 : ((v / 255 + 0.055) / 1.055) ** 2.4));
          return 0.2126 * r + 0.7152 * g + 0.0722 * b;
        };
        const contrast = (a, b) => {
          const [x, y] = [luminance(rgb(a)), luminance(rgb(b))].sort((p, q) => q - p);
          return (x + 0.05) / (y + 0.05);
        };
        const pairs = ['text', 'quiet', 'warn', 'bad', 'accent', 'mark', 'axis-x', 'axis-y', 'axis-z'].map((n) => [`--${n}`, '--solid']);
        pairs.push(['--on-accent', '--accent'], ['--quiet', '--ground']);
        return pairs.map(([a, b]) => [`${a} on ${b}`, contrast(a, b)]);
      });
      const poor = contrasts.filter(([, ratio]) => !(ratio >= kContrast));
      assert.deepEqual(poor, [], `${colorScheme} theme`);
      await page.close();
    }
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
