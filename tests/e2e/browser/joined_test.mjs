// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium: recordings one behind the other in a file are one to the page, also where one was cut short,
// and what `relievo recover` makes of them is the same frames. Run as: in_own_domain node joined_test.mjs
// GATEWAY_FEEDER RELIEVO_SERVER RELIEVO, in web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { basename, join } from 'node:path';
import { launchChromium } from './chromium.mjs';
import { Feeder, inState, look, pagesOf, runChecks } from './feeder.mjs';
import { recordObject } from './recorded.mjs';
import { seek } from './timeline.mjs';

const [feederPath, serverPath, relievoPath] = process.argv.slice(2);
const kFrames = [4, 9, 6];

const scratch = mkdtempSync(join(tmpdir(), 'relievo-joined-'));
// The second of several chunks, of which some are left where it is cut short, unless this machine was too slow to record at
// a rig's pace; frames that build on others.
const recorded = kFrames.map((frames, i) =>
  recordObject(serverPath, join(scratch, `part${i}.mcap`), { rate: 6, frames, options: ['--key-interval', '3'] }));
const parts = recorded.map((file) => readFileSync(file));
/** The camera's numbers of each recording's frames. */
const numbers = recorded.map((file, i) => {
  const folder = join(scratch, `png${i}`);
  execFileSync(relievoPath, ['export', file, '--out', folder, '--format', 'png'], { stdio: 'ignore' });
  return readdirSync(folder).sort().map((name) => parseInt(name, 10));
});
/** Those bytes as a file. */
function joined(name, ...bytes) {
  const file = join(scratch, `${name}.mcap`);
  writeFileSync(file, Buffer.concat(bytes));
  return file;
}
/** How many frames `relievo recover` finds in a file; it writes them into `out`. */
function recover(file, out) {
  execFileSync(relievoPath, ['recover', file, '--out', out], { stdio: 'ignore' });
  return JSON.parse(execFileSync(relievoPath, ['info', out, '--json'], { encoding: 'utf8' })).frames;
}

const feeder = await Feeder.start(feederPath);
const browser = await launchChromium();
const complaints = [];
const { open } = pagesOf(browser, `http://127.0.0.1:${feeder.port}`, complaints);
const playback = (page) => page.evaluate(() => window.relievo.diagnostics().playback);

/** Opens a file and goes to each of its frames, of which these are the camera's numbers: the mean depth of each. */
async function depthsOf(page, file, expected) {
  await page.setInputFiles('#file', file);
  await page.waitForFunction((name) => window.relievo.diagnostics().file === name, basename(file));
  await inState(page, 'file');
  await page.waitForFunction(() => !window.relievo.diagnostics().playback.playing); // to its end
  const { times } = await playback(page);
  assert.equal(times.length, expected.length);
  const depths = [];
  for (const [i, number] of expected.entries()) {
    await seek(page, i);
    await page.waitForFunction(
      ([index, wanted]) => window.relievo.diagnostics().playback.index === index && window.relievo.surface()?.number === wanted,
      [i, number],
    );
    depths.push((await page.evaluate(() => window.relievo.surface())).depth);
  }
  assert.equal((await look(page)).errors, 0, (await look(page)).lastError);
  return depths;
}

// A page decodes its first frames in TypeScript, until the WebAssembly is there, which rounds elsewhere.
function assertSame(depths, expected) {
  assert.equal(depths.length, expected.length);
  for (const [i, depth] of depths.entries()) assert.ok(Math.abs(depth - expected[i]) < 1e-6 * depth, `frame ${i}: ${depth}, not ${expected[i]}`);
}

let whole;
const checks = {
  async 'recordings that were joined are one'(page) {
    whole = await depthsOf(page, joined('whole', ...parts), numbers.flat());
    assert.ok(new Set(whole.map((depth) => depth.toFixed(6))).size > Math.max(...kFrames) / 2, 'the surfaces are all alike');
    assert.doesNotMatch(await page.textContent('#source'), /cut short|left out/);
  },

  async 'they are what recover makes of them'(page) {
    const out = join(scratch, 'recovered.mcap');
    assert.equal(recover(joined('whole', ...parts), out), whole.length);
    assertSame(await depthsOf(page, out, numbers.flat()), whole);
  },

  async 'behind one that was cut short the next is there, and it is said'(page) {
    const [first, second, third] = parts;
    const file = joined('cut', first, second.subarray(0, Math.floor(second.length * 0.6)), third);
    const count = recover(file, join(scratch, 'of_cut.mcap'));
    const left = count - kFrames[0] - kFrames[2]; // of the second
    assert.ok(left >= 0 && left < kFrames[1], `${count} frames`);
    const some = await depthsOf(page, file, [...numbers[0], ...numbers[1].slice(0, left), ...numbers[2]]);
    assertSame(some, [...whole.slice(0, kFrames[0] + left), ...whole.slice(kFrames[0] + kFrames[1])]);
    assert.match(await page.textContent('#source'), /cut short|left out/);
  },

  async 'as PLYs each of their frames has a file of its own, called as relievo export calls it'(page) {
    const file = joined('whole', ...parts);
    const folder = join(scratch, 'ply');
    execFileSync(relievoPath, ['export', file, '--out', folder, '--format', 'ply'], { stdio: 'ignore' });
    await page.setInputFiles('#file', file);
    await page.waitForFunction((n) => window.relievo.diagnostics().playback?.times.length === n, whole.length);
    await page.click('#tool-take');
    const [zip] = await Promise.all([page.waitForEvent('download'), page.click('#range button:text-is("PLYs")')]);
    const list = 'import sys, zipfile\nprint(*sorted(zipfile.ZipFile(sys.argv[1]).namelist()))';
    const names = execFileSync('python3', ['-c', list, await zip.path()], { encoding: 'utf8' }).trim().split(' ');
    assert.deepEqual(names, readdirSync(folder).filter((name) => name.endsWith('.ply')).sort());
    assert.equal(new Set(names).size, whole.length);
  },

  async 'no error, no request to another host'() {
    assert.deepEqual(complaints, []);
  },
};

let failed = 1;
try {
  failed = await runChecks(checks, await open());
} finally {
  await browser.close();
  await feeder.kill();
  rmSync(scratch, { recursive: true, force: true });
}
process.exit(failed === 0 ? 0 : 1);
