// SPDX-License-Identifier: Apache-2.0
// Firefox for a browser test, which runs in web/viewer, where playwright-core is installed; over WebDriver BiDi.
import { spawn } from 'node:child_process';
import { existsSync, readdirSync, readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join } from 'node:path';
import { eventually, kPatienceMs } from './chromium.mjs';

const executablePath = ['/usr/bin/firefox-esr', '/usr/bin/firefox'].find(existsSync);
if (executablePath === undefined || !existsSync('/usr/bin/Xvfb')) {
  console.log('skipped: no Firefox here, or no screen for it; apt-get install firefox-esr xvfb');
  process.exit(77);
}
const { _bidiFirefox: firefox } = createRequire(join(process.cwd(), 'package.json'))('playwright-core');

/** Without a screen it has no WebGL: this is one of its own, in memory. Its name. */
async function startScreen() {
  // However this process ends, the screen goes, and with it Firefox.
  const screen = spawn('setpriv', ['--pdeathsig', 'KILL', 'Xvfb', '-displayfd', '3', '-screen', '0', '1280x1024x24', '-nolisten', 'tcp'], {
    stdio: ['ignore', 'ignore', 'inherit', 'pipe'],
  });
  const number = await new Promise((resolve, reject) => {
    screen.stdio[3].once('data', resolve);
    screen.once('exit', (code) => reject(new Error(`Xvfb ended with status ${code}`)));
  });
  return `:${String(number).trim()}`;
}

/** A browser of its own that saves what is taken away in the folder `saved`; who starts it closes it. */
export const launchFirefox = async (saved) =>
  firefox.launch({
    executablePath,
    headless: false,
    timeout: kPatienceMs,
    env: { ...process.env, DISPLAY: await startScreen() },
    firefoxUserPrefs: { 'webgl.force-enabled': true, 'browser.download.folderList': 2, 'browser.download.dir': saved },
  });

/** The bytes of the file that `act()` makes appear in the folder, once it is whole. */
export async function savedBy(folder, act) {
  const before = new Set(readdirSync(folder));
  await act();
  let added;
  await eventually('nothing is saved', () => {
    const now = readdirSync(folder);
    added = now.filter((name) => !before.has(name));
    return added.length === 1 && !now.some((name) => name.endsWith('.part')) && readFileSync(join(folder, added[0])).length > 0;
  });
  return { file: join(folder, added[0]), bytes: readFileSync(join(folder, added[0])) };
}
