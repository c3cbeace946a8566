// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium against `relievo-server serve`: in the rig camera's view each pixel is what that camera saw
// there, its lens's distortion included. Run as: in_own_domain node lens_test.mjs RELIEVO_SERVER, in web/viewer. Exit 77:
// no Chromium here.
import assert from 'node:assert/strict';
import { launchChromium } from './chromium.mjs';
import { inState, look, pagesOf, press, runChecks, shownPast } from './feeder.mjs';
import { Server } from './server.mjs';

const kSource = 'sim:object,width=320,height=240,stripes=60,rate=5,distortion=1';
const kPage = { width: 960, height: 640 };

const server = await Server.start(process.argv[2], ['--source', kSource]);
const browser = await launchChromium();
const complaints = [];
const { open } = pagesOf(browser, server.address, complaints);

const checks = {
  async 'each pixel is where the camera saw it'(page) {
    await shownPast(page, 2);
    await page.keyboard.press(' ');
    await inState(page, 'shifted');
    await press(page, 'v');
    await press(page, 'c');
    const { streams: [{ rig: { camera } }] } = await (await fetch(`${server.address}/api/streams`)).json();
    const [k1, k2, p1, p2, k3] = camera.distortion;
    /** The pixel that sees what a camera of the same matrix, but a straight lens, sees at this one. */
    const bent = (column, row) => {
      const [x, y] = [(column - camera.cx) / camera.fx, (row - camera.cy) / camera.fy];
      const r2 = x * x + y * y;
      const radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
      return [
        camera.cx + camera.fx * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)),
        camera.cy + camera.fy * (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y),
      ];
    };
    const picture = await page.evaluate(() => {
      const { width, height } = document.querySelector('#picture');
      return [...document.querySelector('#picture').getContext('2d').getImageData(0, 0, width, height).data];
    });
    const seenAt = (column, row) => picture.slice(4 * (Math.round(row) * camera.width + Math.round(column)), 4 * (Math.round(row) * camera.width + Math.round(column)) + 3);
    const { cameraPicture } = await look(page);
    const scale = cameraPicture.width / camera.width;
    const off = { lens: [], straight: [] };
    const places = [];
    for (let row = 6; row < camera.height - 6; row += 11) {
      for (let column = 6; column < camera.width - 6; column += 11) {
        const [x, y] = bent(column, row);
        if (Math.hypot(x - column, y - row) < 2) continue; // the two lenses hardly differ there
        places.push({ at: [cameraPicture.x + (column + 0.5) * scale, cameraPicture.y + (row + 0.5) * scale], lens: seenAt(column, row), straight: seenAt(x, y) });
      }
    }
    const colours = await page.evaluate(async (all) => {
      const found = [];
      for (const at of all) found.push(await window.relievo.pixelAt(...at));
      return found;
    }, places.map(({ at }) => at));
    for (const [i, [r, g, b, alpha]] of colours.entries()) {
      if (alpha < 255) continue;
      const away = (rgb) => Math.hypot(...[r, g, b].map((c, channel) => c - rgb[channel]));
      for (const of of ['lens', 'straight']) off[of].push(away(places[i][of]));
    }
    const mean = (values) => values.reduce((sum, v) => sum + v, 0) / values.length;
    console.log(`      ${off.lens.length} places: off by ${mean(off.lens).toFixed(2)} levels, as a straight lens would see them by ${mean(off.straight).toFixed(2)}`);
    assert.ok(off.lens.length > 50, `${off.lens.length} places are covered`);
    assert.ok(mean(off.lens) < 0.5 * mean(off.straight), JSON.stringify(off));
  },

  async 'no error, no request to another host'() {
    assert.deepEqual(complaints, []);
  },
};

let failed = 1;
try {
  failed = await runChecks(checks, await open('/', { viewport: kPage }));
} finally {
  await browser.close();
  await server.kill();
}
process.exit(failed === 0 ? 0 : 1);
