// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium: what is taken away is what was seen (picture, video, PLY, GLB, link), and the
// statistics panel says what the page itself measures. The video's pictures are those that ffmpeg decodes, where it is there.
// Run as: node take_test.mjs GATEWAY_FEEDER, in web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { execFileSync, spawnSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { eventually, kPatienceMs, launchChromium } from './chromium.mjs';
import { depthOf, Feeder, inState, isRim, look, pagesOf, runChecks, shownPast, stayWhenAsked, still } from './feeder.mjs';

const feeder = await Feeder.start(process.argv[2]);
const origin = `http://127.0.0.1:${feeder.port}`;
const browser = await launchChromium();
const complaints = [];
const { open } = pagesOf(browser, origin, complaints);
let bytesOfPly;
const kFrame = 62;

async function saved(page, name) {
  const [file] = await Promise.all([page.waitForEvent('download'), page.click(`#panel-take button:text-is("${name}")`)]);
  return { name: file.suggestedFilename(), bytes: readFileSync(await file.path()) };
}

/** The pictures of a video, as another program decodes them; null: there is none here. */
function decoded(bytes) {
  if (spawnSync('ffmpeg', ['-version']).error !== undefined) return null;
  const scratch = mkdtempSync(join(tmpdir(), 'relievo-take-'));
  const file = join(scratch, 'video');
  try {
    writeFileSync(file, bytes);
    const told = execFileSync('ffprobe', ['-v', 'error', '-show_entries', 'frame=width,height', '-of', 'csv=p=0', file], { encoding: 'utf8' });
    const sizes = told.trim().split('\n').map((line) => line.split(',').slice(0, 2).map(Number));
    const [width, height] = sizes[0];
    const rgb = execFileSync('ffmpeg', ['-v', 'error', '-i', file, '-fps_mode', 'passthrough', '-f', 'rawvideo', '-pix_fmt', 'rgb24', '-'], { maxBuffer: 2 ** 30 });
    const pictures = sizes.map((_, i) => rgb.subarray(i * width * height * 3, (i + 1) * width * height * 3));
    return { sizes, width, height, pictures };
  } finally {
    rmSync(scratch, { recursive: true });
  }
}

/** Mean and standard deviation of each colour in a square of a picture. */
function colourOf(picture, width, { x, y }, half) {
  const sums = [0, 1, 2].map(() => [0, 0]);
  let count = 0;
  for (let row = y - half; row < y + half; ++row) {
    for (let column = x - half; column < x + half; ++column, ++count) {
      for (const c of [0, 1, 2]) {
        const value = picture[(row * width + column) * 3 + c];
        sums[c][0] += value;
        sums[c][1] += value * value;
      }
    }
  }
  const means = sums.map(([sum]) => sum / count);
  return { means, deviations: sums.map(([, squares], c) => Math.sqrt(Math.max(0, squares / count - means[c] ** 2))) };
}
const apart = (a, b) => Math.max(...a.map((v, i) => Math.abs(v - b[i])));

const checks = {
  async 'the statistics panel adds up'(page) {
    await shownPast(page, 4);
    await page.keyboard.press('i');
    await page.waitForFunction(() => window.relievo.diagnostics().stages !== null);
    for (const words of [/codecsDraco, JPEG/, /server's clock ahead by-?[\d.]+ ± [\d.]+ ms/]) {
      await page.waitForFunction((of) => new RegExp(of).test(document.querySelector('#panel-statistics')?.textContent), words.source);
    }
    await page.waitForFunction(() => /ms/.test(document.querySelector('#panel-statistics .stage-4 + dd')?.textContent));
    const { parts, stages, latencyMs } = await look(page);
    assert.ok(parts.geometry > 1000 && parts.texture > 1000 && parts.header === 80, JSON.stringify(parts));
    const total = Object.values(stages).reduce((sum, ms) => sum + ms, 0);
    assert.ok(Object.values(stages).every((ms) => ms >= -1), JSON.stringify(stages));
    assert.ok(total > 0 && total < kPatienceMs, `${total} ms of ${latencyMs}`);
    assert.ok(await page.isVisible('#panel-statistics .plot'));
  },

  async 'a frame that comes very late is cut off at the top of the plot, with its number there'(page) {
    const shown = () => page.evaluate(() => window.relievo.diagnostics().shown);
    await shownPast(page, (await shown()) + 40); // of which one does not set the scale
    await page.evaluate(() => {
      const { fillText } = CanvasRenderingContext2D.prototype;
      CanvasRenderingContext2D.prototype.fillText = function (said, ...at) {
        if (/^↑ /.test(said)) window.beyond_ = said;
        return fillText.call(this, said, ...at);
      };
    });
    await eventually('no number tells of what is cut off', async () => {
      await page.evaluate(() => { for (const end = performance.now() + 2500; performance.now() < end; ); });
      await shownPast(page, (await shown()) + 10);
      return page.evaluate(() => Number(/^↑ (\d+)/.exec(window.beyond_ ?? '')?.[1]) > 1000);
    });
    const above = await page.$eval('#panel-statistics .plot', (plot) => {
      const { data } = plot.getContext('2d').getImageData(0, 0, plot.width, Math.floor((7 * plot.width) / plot.clientWidth));
      return data.some((value, i) => i % 4 === 3 && value > 0);
    });
    assert.ok(!above, 'lines run beyond the top of the plot');
  },

  async 'a picture has a transparent ground and the surface on it'(page) {
    await feeder.standStill(page, kFrame);
    await page.keyboard.press('Escape');
    await page.keyboard.press('ArrowLeft'); // the eye is set by hand: a panel moves it no more
    await still(page);
    const { pixels } = await look(page);
    const middle = await page.evaluate(() => window.relievo.toPage([0, 0, 1.2]).x);
    await page.keyboard.press('t');
    await still(page);
    assert.ok((await page.evaluate(() => window.relievo.toPage([0, 0, 1.2]).x)) < middle - 100, 'the panel has moved nothing aside');
    const { name, bytes } = await saved(page, 'Picture');
    assert.match(name, /^relievo-ball-\d{6}\.png$/);
    const { corner, covered, column, width } = await page.evaluate(async (data) => {
      const bitmap = await createImageBitmap(new Blob([Uint8Array.from(atob(data), (c) => c.charCodeAt(0))]));
      const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d');
      context.drawImage(bitmap, 0, 0);
      const rgba = context.getImageData(0, 0, bitmap.width, bitmap.height).data;
      let [opaque, columns] = [0, 0];
      for (let i = 0; i < bitmap.width * bitmap.height; ++i) {
        if (rgba[4 * i + 3] <= 128) continue;
        ++opaque;
        columns += i % bitmap.width;
      }
      return { corner: rgba[3], covered: opaque / (bitmap.width * bitmap.height), column: columns / opaque, width: bitmap.width };
    }, bytes.toString('base64'));
    assert.equal(corner, 0);
    // The panel that was open has no part in it.
    assert.ok(Math.abs(column / width - middle / 800) < 0.06, `its middle is at ${column} of ${width}, not at ${middle} of 800`);
    assert.ok(Math.abs(covered - pixels.covered) < 0.01, `${covered}, not ${pixels.covered}`);
  },

  async 'a video of the view can be played'(page) {
    feeder.say('start ball');
    await page.click('#panel-take button:text-is("Video")');
    await page.waitForSelector('#panel-take button:text-is("Stop video")');
    const { shown } = await look(page);
    await shownPast(page, shown + 8);
    // What a loaded machine has not encoded by the end is lost: it is told each second how far it is.
    const filmed = async () => Number(/^Video: (\d+) kB so far$/.exec(await page.textContent('#panel-take [role=status]'))?.[1] ?? 0);
    let [growths, last] = [0, 0];
    await eventually('the video does not grow', async () => {
      const now = await filmed();
      if (now > last) ++growths;
      last = now;
      return growths >= 5;
    });
    const at = await page.evaluate(() => {
      const { x, y } = window.relievo.toPage([0, 0, 1]);
      const ground = getComputedStyle(document.documentElement).getPropertyValue('--ground').trim();
      return { x: Math.round(x), y: Math.round(y), ground: [1, 3, 5].map((i) => parseInt(ground.slice(i, i + 2), 16)) };
    });
    await page.waitForFunction(() => /^video \d+:\d\d, [\d.]+ MB$/.test(document.querySelector('#recording:not([hidden])')?.textContent));
    await stayWhenAsked(page); // it is not saved yet
    const { name, bytes } = await saved(page, 'Stop video');
    await page.waitForSelector('#recording', { state: 'hidden' });
    assert.match(name, /\.(webm|mp4)$/);
    assert.ok(bytes.length > 2000, `${bytes.length} bytes`);
    const isWebm = bytes.readUInt32BE(0) === 0x1a45dfa3;
    const isMp4 = bytes.subarray(4, 8).toString() === 'ftyp';
    assert.ok(isWebm || isMp4, 'neither WebM nor MP4');
    assert.ok(await page.isVisible('#panel-take button:text-is("Video")'));
    const video = decoded(bytes);
    if (video === null) return console.log('      its pictures are not looked at: no ffmpeg here; apt-get install ffmpeg');
    const { sizes, width, pictures } = video;
    assert.ok(pictures.length >= 5, `${pictures.length} pictures`);
    assert.deepEqual(sizes.filter(([w, h]) => w !== 800 || h !== 500), [], 'pictures of another size');
    for (const [i, picture] of pictures.entries()) {
      assert.equal(picture.length, 800 * 500 * 3, `picture ${i} is not whole`);
      const middle = colourOf(picture, width, at, 50); // of the ball, with its squares
      assert.ok(Math.max(...middle.deviations) > 10, `picture ${i} is uniform: ${middle.deviations}`);
      assert.ok(apart(middle.means, at.ground) > 40, `picture ${i} shows no surface: ${middle.means}`);
      for (const x of [20, 780]) {
        const { means } = colourOf(picture, width, { x, y: 20 }, 10);
        assert.ok(apart(means, at.ground) < 12, `picture ${i} has ${means} at ${x}, and the ground is ${at.ground}`);
      }
    }
    const [first, final] = [pictures[0], pictures.at(-1)];
    const moved = first.reduce((sum, v, i) => sum + Math.abs(v - final[i]), 0) / first.length;
    assert.ok(moved > 0.5, `nothing moves: ${moved}`);
    console.log(`      ${pictures.length} pictures; the last one is ${moved.toFixed(1)} of 255 off the first`);
  },

  async 'the surface is taken away as PLY and GLB'(page) {
    await feeder.standStill(page, kFrame);
    await still(page);
    const { frame, vertices, triangles } = await look(page);
    const ply = await saved(page, 'PLY');
    bytesOfPly = ply.bytes;
    const header = ply.bytes.subarray(0, 600).toString('latin1');
    assert.ok(header.includes(`element vertex ${vertices}\n`) && header.includes(`element face ${triangles}\n`), header);
    const start = header.indexOf('end_header\n') + 11;
    for (let v = 0; v < vertices; v += 997) {
      const [x, y, z] = [0, 4, 8].map((at) => ply.bytes.readFloatLE(start + v * 15 + at));
      const [u, w] = [(x * 800) / (640 * z) + 0.5, (y * 800) / (480 * z) + 0.5];
      if (isRim(u, w, frame)) continue;
      assert.ok(Math.abs(z - depthOf(u, w, frame)) < 0.003, `vertex ${v}: ${z}, not ${depthOf(u, w, frame)}`);
    }
    const glb = await saved(page, 'GLB');
    assert.equal(glb.bytes.readUInt32LE(0), 0x46546c67);
    assert.equal(glb.bytes.readUInt32LE(8), glb.bytes.length);
    const extent = await page.evaluate(() => window.relievo.extent());
    await page.setInputFiles('#file', { name: 'back.glb', mimeType: 'model/gltf-binary', buffer: glb.bytes });
    await page.waitForFunction(() => window.relievo.diagnostics().file === 'back.glb');
    await still(page);
    const back = await page.evaluate(() => window.relievo.extent());
    for (const i of [0, 1, 2]) assert.ok(Math.abs(back.max[i] - extent.max[i]) < 1e-4, `${back.max}, not ${extent.max}`);
    await page.setInputFiles('#file', { name: 'back.ply', mimeType: 'application/octet-stream', buffer: bytesOfPly });
    await page.waitForFunction(() => window.relievo.diagnostics().file === 'back.ply');
    await still(page);
    assert.ok((await look(page)).pixels.covered > 0.1);
  },

  async 'a link shows somebody else the same'() {
    feeder.say('start ball');
    const page = await open('/?stream=ball');
    await inState(page, 'live');
    await shownPast(page, 1);
    await page.keyboard.press('5');
    await page.keyboard.press('g');
    await page.keyboard.press('ArrowLeft');
    await page.keyboard.press('+');
    // Both of one moment: the eye may still be gliding.
    const { link, pose } = await page.evaluate(() => ({ link: window.relievo.link(), pose: window.relievo.pose() }));
    await page.close();
    const other = await open(link.slice(origin.length));
    await inState(other, 'live');
    await shownPast(other, 2);
    const now = await look(other);
    assert.equal(now.stream, 'ball');
    assert.equal(now.mode, 'normals');
    assert.equal(now.gridStep, null);
    const same = await other.evaluate(() => window.relievo.pose());
    for (const part of ['position', 'target']) {
      for (const i of [0, 1, 2]) assert.ok(Math.abs(same[part][i] - pose[part][i]) < 1e-3, `${part} ${same[part]}, not ${pose[part]}`);
    }
    // Pasted into a page that is open.
    await other.evaluate(() => (location.hash = '#mode=depth&eye=0.6_0.3_0.4&at=0.1_-0.05_-0.9'));
    await other.waitForFunction(() => window.relievo.diagnostics().mode === 'depth');
    await other.waitForFunction(() => /eye=0.6_0.3_0.4&at=0.1_-0.05_-0.9/.test(window.relievo.link()));
    await other.close();
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
