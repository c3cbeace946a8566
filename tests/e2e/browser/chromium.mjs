// SPDX-License-Identifier: Apache-2.0
// Headless Chromium for the browser tests, which run in web/viewer, where playwright-core is installed.
import { existsSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join } from 'node:path';

const executablePath = ['/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'].find(existsSync);
if (executablePath === undefined) {
  console.log('skipped: no Chromium here; apt-get install chromium');
  process.exit(77);
}
process.env.PW_EXPERIMENTAL_SERVICE_WORKER_NETWORK_EVENTS = '1'; // a context's events are its service workers', too
const { chromium } = createRequire(join(process.cwd(), 'package.json'))('playwright-core');
const kFlags = [
  '--no-sandbox',
  '--disable-gpu',
  '--disable-quic',
  '--no-first-run',
  '--disable-background-networking',
  '--disable-component-update',
  '--disable-sync',
];

/** For anything that happens by itself, however slow or loaded the machine. */
export const kPatienceMs = 180_000;
/** For a program that computes all the while: a calibration's views, and what is calculated of them. */
export const kLongPatienceMs = 300_000;

/** A browser of its own; who starts it closes it. */
export const launchChromium = (flags = []) =>
  chromium.launch({ executablePath, headless: true, args: [...kFlags, ...flags], timeout: kPatienceMs });

/** Waits until `condition()`, which may be asynchronous, is true; fails with `what` where it does not come true. */
export async function eventually(what, condition) {
  for (const end = Date.now() + kPatienceMs; !(await condition()); ) {
    if (Date.now() > end) throw new Error(typeof what === 'function' ? what() : what);
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}
