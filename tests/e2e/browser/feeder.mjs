// SPDX-License-Identifier: Apache-2.0
// A gateway with a surface of known shape (tests/support/gateway_feeder.cpp), and pages that show it.
import { spawn } from 'node:child_process';
import { eventually, kPatienceMs } from './chromium.mjs';

const kRate = '8';

export class Feeder {
  static async start(path, port = 0) {
    const feeder = new Feeder();
    feeder.process = spawn(path, [String(port), kRate], { stdio: ['pipe', 'pipe', 'inherit'] });
    const line = await new Promise((resolve, reject) => {
      feeder.process.stdout.once('data', resolve);
      feeder.process.once('exit', () => reject(new Error('the feeder did not start')));
    });
    feeder.port = Number(String(line).split(' ')[1]);
    return feeder;
  }
  /** On a port that was just another's, which the kernel may still hold. */
  static async restart(path, port) {
    let feeder;
    const start = () => Feeder.start(path, port).then((started) => (feeder = started));
    await eventually(`port ${port} does not become free`, () => start().catch(() => false));
    return feeder;
  }
  say(line) {
    this.process.stdin.write(`${line}\n`);
  }
  /** The frame of this number, and none behind it; resolves when the page shows it. */
  async standStill(page, number) {
    this.say(`frame ${number}`);
    await page.waitForFunction((n) => window.relievo.diagnostics().frame === n, number);
  }
  async kill() {
    if (this.process.exitCode !== null || this.process.signalCode !== null) return;
    const ended = new Promise((resolve) => this.process.once('exit', resolve));
    this.process.kill('SIGKILL');
    await ended;
  }
}

/** Depth of the feeder's surface in metres, at a share of the picture's width and height, in a frame of this number. */
export function depthOf(u, v, number) {
  const t = (number + 1) * 0.05;
  const [dx, dy] = [(u - 0.5 - 0.12 * Math.sin(t)) * 1.33, v - 0.5];
  const r2 = dx * dx + dy * dy;
  const bump = r2 < 0.09 ? Math.sqrt(0.09 - r2) : 0;
  return 1.2 - 0.6 * bump - 0.012 * Math.sin(14 * u + 3 * t) * Math.cos(11 * v);
}

/** Whether the ball's rim is so near, where its slope has no bound, that triangles cannot follow it. */
export function isRim(u, v, number) {
  const cx = 0.5 + 0.12 * Math.sin((number + 1) * 0.05);
  return Math.abs(Math.hypot((u - cx) * 1.33, v - 0.5) - 0.3) < 0.04;
}

export const kPicture = { width: 640, height: 480, focal: 800 };

/** The point of the surface there, in the rig camera's frame. */
export function pointOf(u, v, number) {
  const z = depthOf(u, v, number);
  return [((u - 0.5) * kPicture.width * z) / kPicture.focal, ((v - 0.5) * kPicture.height * z) / kPicture.focal, z];
}

/** newPage and open, of a browser; complaints gathers what should not happen. */
export function pagesOf(browser, origin, complaints) {
  async function newPage(options = {}) {
    const page = await browser.newPage(options);
    page.setDefaultTimeout(kPatienceMs);
    return page;
  }

  async function open(path = '/', options = {}) {
    const page = await newPage({ viewport: { width: 800, height: 500 }, ...options });
    page.on('pageerror', (error) => complaints.push(`page error: ${error.message}`));
    page.on('console', (message) => {
      if (message.type() === 'error') complaints.push(`console: ${message.text()}`);
    });
    page.on('request', (request) => {
      const url = request.url();
      const own = url.startsWith(`${origin}/`) || url.startsWith('data:') || url.startsWith('blob:');
      if (!own) complaints.push(`request to another host: ${url}`);
    });
    page.on('websocket', (socket) => {
      if (!socket.url().startsWith(origin.replace('http', 'ws'))) complaints.push(`socket to ${socket.url()}`);
    });
    await page.goto(origin + path);
    await loaded(page);
    return page;
  }

  return { newPage, open };
}

/** Until the page's own code is there, which comes behind the document. */
export const loaded = (page) => page.waitForFunction(() => window.relievo !== undefined);
export const look = (page) =>
  page.evaluate(async () => ({ ...window.relievo.diagnostics(), pixels: await window.relievo.readPixels() }));
export const inState = (page, state) =>
  page.waitForFunction((wanted) => window.relievo?.diagnostics().state === wanted, state);
export const shownPast = (page, count) =>
  page.waitForFunction((least) => window.relievo?.diagnostics().shown >= least, count);
/** Until nothing is drawn any more: what was under way has arrived, and no motion is left. */
export async function still(page) {
  const now = () => page.evaluate(() => window.relievo.diagnostics());
  await eventually('the picture does not come to rest', async () => {
    const before = await now();
    if (before.busy) return false;
    await page.waitForTimeout(700);
    const after = await now();
    return !after.busy && after.drawn === before.drawn && after.received === before.received;
  });
}

/** Shares of the picture with flat ground and with the ball. */
export const kPlaces = [[0.1, 0.15], [0.9, 0.2], [0.15, 0.85], [0.5, 0.5], [0.4, 0.6], [0.85, 0.8]];

export const pick = (page, { x, y }) => page.evaluate(([px, py]) => window.relievo.pick(px, py), [x, y]);
export const toPage = (page, point) => page.evaluate((p) => window.relievo.toPage(p), point);
/** What is picked, and the colour, where a point of the rig camera's frame is drawn: of one moment, whatever moves. */
export const pickAt = (page, point) =>
  page.evaluate((p) => {
    const { x, y } = window.relievo.toPage(p);
    return window.relievo.pick(x, y);
  }, point);
export const colourAt = (page, point) =>
  page.evaluate((p) => {
    const { x, y } = window.relievo.toPage(p);
    return window.relievo.pixelAt(x, y);
  }, point);
/**
 * Where such a point is on the page once it stays there, also while a stream goes on: a panel that opens, or a line more
 * below, moves it some drawings later.
 */
export const restingPlace = (page, point) =>
  page.evaluate(async (p) => {
    for (let [before, same] = [null, 0]; ; ) {
      const now = window.relievo.toPage(p);
      same = before !== null && Math.hypot(now.x - before.x, now.y - before.y) < 0.01 ? same + 1 : 0;
      if (same === 5) return now;
      before = now;
      await new Promise((resolve) => requestAnimationFrame(() => setTimeout(resolve, 20)));
    }
  }, point);
export async function press(page, key) {
  await page.keyboard.press(key);
  await still(page);
}

/** Loads the page anew, and stays in it when the browser asks; fails where it does not ask. */
export async function stayWhenAsked(page) {
  const asked = page.waitForEvent('dialog');
  await page.evaluate(() => void setTimeout(() => location.reload()));
  await (await asked).dismiss();
}

/** The page's parts may grow by a line before the view follows: its middle is off by no more than this. */
export const kJitter_px = 13;

/** The middle of what header, tools, an open panel and time line leave free of the page: around it a view turns. */
export const freeMiddle = (page) =>
  page.evaluate(() => {
    const box = (of) => document.querySelector(of).getBoundingClientRect();
    const panel = document.querySelector('#panels aside:not([hidden])');
    return { x: (panel ?? document.querySelector('#rail')).getBoundingClientRect().left / 2, y: (box('header').bottom + box('footer').top) / 2 };
  });

/** Runs named checks one after the other; the number of those that failed. */
export async function runChecks(checks, page) {
  let failed = 0;
  for (const [name, check] of Object.entries(checks)) {
    const start = Date.now();
    try {
      await check(page);
      console.log(`ok    ${name} (${Date.now() - start} ms)`);
    } catch (error) {
      ++failed;
      console.log(`FAIL  ${name}: ${error.stack}`);
      console.log('      ', JSON.stringify(await page.evaluate(() => window.relievo?.diagnostics()).catch(() => null)));
    }
  }
  console.log(failed === 0 ? 'all checks passed' : `${failed} of ${Object.keys(checks).length} checks failed`);
  return failed;
}
