// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium: where the server has no folder for recordings, the record button saves what the page
// keeps and what follows as a recording that `relievo` reads whole and the page shows as it was; where it has one, the
// server records there, with what came before, and lists the file, which plays while it is being written and grows. Nobody
// leaves unasked with what is not saved, and of a server that has gone nothing is said to go on.
// Run as: in_own_domain node record_test.mjs RELIEVO_SERVER RELIEVO, in web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { copyFileSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, renameSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { eventually, launchChromium } from './chromium.mjs';
import { inState, look, pagesOf, runChecks, shownPast, stayWhenAsked, still } from './feeder.mjs';
import { Server } from './server.mjs';

const [serverPath, relievoPath] = process.argv.slice(2);
const scratch = mkdtempSync(join(tmpdir(), 'relievo-record-'));
const saved = join(scratch, 'saved.mcap');
const folder = join(scratch, 'folder');
const briefFolder = join(scratch, 'brief');
mkdirSync(folder);
mkdirSync(briefFolder);
const serve = ['--source', 'sim:object,width=320,height=240,stripes=60,rate=6', '--key-interval', '5'];
const server = await Server.start(serverPath, serve);
const recordingServer = await Server.start(serverPath, [...serve, '--stream', 'kept', '--record-dir', folder, '--pre-roll', '30s']);
const browser = await launchChromium();
const complaints = [];
const { open } = pagesOf(browser, server.address, complaints);
const { open: openRecording, newPage: newRecording } = pagesOf(browser, recordingServer.address, complaints);
let briefServer; // its recordings are played to their ends, so little comes before
let openBrief;
const playback = (page) => page.evaluate(() => window.relievo.diagnostics().playback);
const kKept = 12;
async function order(action, server = recordingServer, stream = 'kept') {
  const answer = await fetch(`${server.address}/api/recording/${stream}`, {
    method: 'POST',
    body: JSON.stringify({ action }),
    headers: { 'content-type': 'application/json' },
  });
  assert.equal(answer.status, 200, await answer.text());
}
const orderBrief = (action) => order(action, briefServer, 'brief');
async function toEnd(page) {
  await page.keyboard.press('End');
  await page.waitForFunction(() => !window.relievo.diagnostics().playback.playing);
}
let last; // the surface shown last while it was recorded
const pressedIs = (page, is) => page.waitForFunction((p) => document.querySelector('#tool-record')?.getAttribute('aria-pressed') === p, is);
const pillSays = (page, words) => page.waitForFunction((w) => new RegExp(w).test(document.querySelector('#recording:not([hidden])')?.textContent), words);

const checks = {
  async 'what is kept and what follows is saved'(page) {
    await shownPast(page, 2);
    await page.waitForFunction((n) => window.relievo.diagnostics().playback.times.length >= n, kKept);
    await page.click('#tool-record');
    await pressedIs(page, 'true');
    await pillSays(page, '^\\d+:\\d\\d, [\\d.]+ MB$');
    const { shown } = await look(page);
    await shownPast(page, shown + 6);
    await page.focus('#view'); // else the space bar presses the button again
    await page.keyboard.press(' ');
    await inState(page, 'shifted'); // the surface stays, what comes is recorded all the same
    last = await page.evaluate(() => window.relievo.surface());
    const { times } = await playback(page);
    await page.waitForFunction((n) => window.relievo.diagnostics().playback.times.length >= n, times.length + 4);
    const [file] = await Promise.all([page.waitForEvent('download'), page.keyboard.press('x')]);
    assert.match(file.suggestedFilename(), /^object-\d{8}-\d{6}\.mcap$/);
    await pillSays(page, 'object-.*\\.mcap: \\d+ frames'); // for ten seconds
    await file.saveAs(saved);
    await pressedIs(page, 'false');
  },

  async 'who would leave with what is not saved is asked first'() {
    const page = await open();
    await shownPast(page, 2);
    await page.click('#tool-record');
    await pressedIs(page, 'true');
    await stayWhenAsked(page);
    await Promise.all([page.waitForEvent('download'), page.click('#tool-record')]);
    await pillSays(page, 'object-.*mcap: ');
    await page.reload(); // not asked: it is saved
    await shownPast(page, 1);
    await page.close();
  },

  async 'relievo reads it whole'() {
    const told = JSON.parse(execFileSync(relievoPath, ['info', '--json', saved], { encoding: 'utf8' }));
    assert.equal(told.stream, 'object');
    assert.ok(told.frames >= kKept + 6 + 4, `${told.frames} frames`);
    assert.equal(told.unreadable, 0);
    assert.equal(told.damaged_parts, 0);
    assert.equal(told.recovered, false);
    assert.equal(told.info.pattern.stripes, 60);
    assert.deepEqual(told.info.rig.camera.size, [320, 240]);
    assert.equal(told.info.rig.colour_matrix.length, 9);
    assert.ok(Math.abs(told.info.rig.camera.matrix[0]) > 100, `${told.info.rig.camera.matrix}`);
    execFileSync(relievoPath, ['export', saved, '--out', join(scratch, 'ply'), '--format', 'ply'], { stdio: 'ignore' });
  },

  async 'the page shows it as it was'(page) {
    await page.setInputFiles('#file', saved);
    await inState(page, 'file');
    await page.waitForSelector('#tool-record', { state: 'hidden' });
    await toEnd(page); // as long as the page was slow, it may take a minute to play
    await still(page); // what is drawn is of the file, and no longer of the stream
    const surface = () => page.evaluate(() => window.relievo.surface());
    let now = await surface();
    for (let passed; now.number > last.number; now = await surface()) { // one that is not drawn before the next is not seen
      passed = now.number;
      await page.keyboard.press(',');
      await page.waitForFunction((number) => window.relievo.surface().number !== number, passed);
    }
    assert.equal(now.number, last.number, 'the surface that was seen is not in it');
    assert.ok(Math.abs(now.depth - last.depth) < 1e-6 * last.depth, 'it is another'); // decoders round elsewhere
    const { keys } = await playback(page);
    assert.equal(keys[0], true);
    assert.equal((await look(page)).errors, 0);
    await page.close();
    await server.kill(); // what follows has others
  },

  async 'a server with a folder records there'() {
    const page = await openRecording();
    await shownPast(page, 4);
    const { shown } = await look(page);
    await page.click('#tool-record');
    await pressedIs(page, 'true');
    await shownPast(page, shown + 3);
    await page.click('#tool-record');
    await pillSays(page, 'kept-.*\\.mcap');
    await pressedIs(page, 'false');
    let listed;
    await eventually('the file is not listed as finished', async () => {
      listed = await page.evaluate(async () => (await (await fetch('api/recordings')).json()).recordings[0]);
      return listed?.recording === false;
    });
    assert.deepEqual(readdirSync(folder), [listed.file]);
    const told = JSON.parse(execFileSync(relievoPath, ['info', '--json', join(folder, listed.file)], { encoding: 'utf8' }));
    assert.equal(told.stream, 'kept');
    assert.ok(told.frames >= shown - 1 + 3, `${told.frames} frames, ${shown} shown before`);
    assert.equal(told.damaged_parts, 0);
    await page.close();
  },

  async 'a link to a recording in the folder shows it at its time'() {
    const page = await openRecording();
    await page.click('#tool-streams');
    await page.waitForSelector('#panel-streams li:has-text(".mcap") canvas[data-drawn]');
    const drawn = await page.waitForFunction(() => {
      const canvas = document.querySelector('#panel-streams li canvas[data-drawn][aria-label*=".mcap"]');
      if (canvas === null) return false; // the folder is listed anew now and then
      const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
      const greens = data.filter((_, i) => i % 4 === 1);
      const mean = greens.reduce((sum, v) => sum + v, 0) / greens.length;
      return { deviation: Math.sqrt(greens.reduce((sum, v) => sum + (v - mean) ** 2, 0) / greens.length) };
    });
    const { deviation } = await drawn.jsonValue();
    assert.ok(deviation > 5, `its picture in the list is flat: ${deviation}`);
    await page.click('#panel-streams li:has-text(".mcap") button:has-text("Show")');
    await inState(page, 'file');
    await page.waitForURL(/\/\?recording=kept-[^#&]*\.mcap$/);
    await page.waitForSelector('#panel-streams li.shown:has-text(".mcap") button[aria-pressed="true"]:has-text("Show")');
    assert.match(await page.title(), /^Relievo · kept-.*\.mcap$/);
    const isWhole = () => {
      const name = document.querySelector('#panel-streams li.shown b');
      return name !== null && name.clientWidth > 0 && name.scrollWidth <= name.clientWidth;
    };
    await eventually('its name is cut off', () => page.evaluate(isWhole));
    await page.goBack();
    await page.waitForURL(/\/\?stream=kept$/);
    await inState(page, 'live');
    await page.goForward();
    await inState(page, 'file');
    await page.focus('#view');
    await toEnd(page);
    // What is shown comes behind what is sent.
    for (const [index, key] of ['Home', '.', '.', '.'].entries()) {
      const before = await page.evaluate(() => window.relievo.surface().number);
      await page.keyboard.press(key);
      await page.waitForFunction(([i, number]) => window.relievo.diagnostics().playback.index === i && window.relievo.surface().number !== number, [index, before]);
    }
    const { link, number, file } = await page.evaluate(() => ({ link: window.relievo.link(), number: window.relievo.surface().number, file: window.relievo.diagnostics().file }));
    await page.close();
    const other = await openRecording(link.slice(recordingServer.address.length));
    await other.waitForFunction((n) => window.relievo.diagnostics().frame === n, number);
    assert.equal((await look(other)).file, file);
    const now = await playback(other);
    assert.deepEqual([now.index, now.playing], [3, false]);
    await other.close();
  },

  async 'a link to a moment of a live stream shows it where the server has recorded it'() {
    const page = await openRecording();
    const kept = (frames) => page.waitForFunction((least) => window.relievo.diagnostics().playback?.times.length >= least, frames);
    /** A link to the first frame that is kept. */
    const linked = async () => {
      await page.keyboard.press('Home');
      await inState(page, 'shifted');
      await page.waitForFunction(() => !window.relievo.diagnostics().busy && !window.relievo.diagnostics().playback.playing);
      await page.waitForFunction(() => window.relievo.diagnostics().playback.index === window.relievo.diagnostics().playback.first);
      return page.evaluate(() => ({ path: window.relievo.link().slice(location.origin.length), number: window.relievo.surface().number }));
    };
    await kept(6);
    const { path, number } = await linked();
    assert.match(path, /^\/\?stream=kept#.*&time=\d{4}-/);
    await order('start');
    const newest = () => page.evaluate(async () => (await (await fetch('api/recordings')).json()).recordings[0]);
    await eventually('what is being recorded is not listed', async () => (await newest())?.recording === true);
    for (const where of ['while it is written', 'once it is whole']) {
      const other = await openRecording(path);
      await inState(other, 'file');
      await other.waitForFunction((n) => window.relievo.diagnostics().frame === n, number);
      assert.deepEqual([(await playback(other)).playing, /recording=kept-.*\.mcap/.test(other.url())], [false, true], where);
      await other.close();
      if (where === 'while it is written') await order('stop');
    }
    const late = await openRecording(path.replace(/time=[^&]*/, 'time=2020-01-01T00:00:00.000Z'));
    await inState(late, 'live');
    await late.waitForFunction(() => /is not kept any more/.test(document.querySelector('#source')?.textContent));
    await late.close();
    await page.close();
    const [file] = readdirSync(folder).sort().reverse();
    rmSync(join(folder, file)); // the others are looked at below
  },

  async 'one that a crash cut short is listed so, and plays as far as it is whole'() {
    const [whole] = readdirSync(folder);
    const bytes = readFileSync(join(folder, whole));
    writeFileSync(join(folder, 'cut.mcap'), bytes.subarray(0, Math.floor(bytes.length * 0.7)));
    const { frames } = JSON.parse(execFileSync(relievoPath, ['info', '--json', join(folder, 'cut.mcap')], { encoding: 'utf8', stdio: 'pipe' }));
    const page = await openRecording();
    await page.click('#tool-streams');
    const about = (file) => page.textContent(`#panel-streams li:has-text("${file}") small`);
    await page.waitForSelector('#panel-streams li:has-text("cut.mcap") canvas[data-drawn]');
    assert.match(await about('cut.mcap'), / MB · cut short$/);
    assert.match(await about(whole), / MB$/);
    await page.click('#panel-streams li:has-text("cut.mcap") button:has-text("Show")');
    await inState(page, 'file');
    await shownPast(page, 1);
    const { times } = await playback(page);
    assert.ok(frames > 0 && times.length === frames, `${times.length} of ${frames} frames`);
    assert.equal((await look(page)).errors, 0);
    await page.close();
    rmSync(join(folder, 'cut.mcap'));
  },

  async 'one whose picture cannot be had is asked for again, and no stream of its name'() {
    const [whole] = readdirSync(folder);
    const page = await openRecording();
    const sockets = [];
    page.on('websocket', (socket) => sockets.push(socket.url()));
    let refused = 0;
    await page.route(`**/recordings/${whole}`, (route) => (++refused > 1 ? route.continue() : route.fulfill({ status: 404 })));
    await page.click('#tool-streams');
    await page.waitForSelector(`#panel-streams li:has-text("${whole}") canvas[data-drawn]`);
    assert.deepEqual(sockets.filter((url) => url.includes('.mcap')), []);
    await page.close();
  },

  async 'of a long list the pictures in sight are read, and stay as it grows'() {
    const [whole] = readdirSync(folder);
    const copies = Array.from({ length: 60 }, (_, i) => join(folder, `copy-${String(i).padStart(2, '0')}.mcap`));
    for (const copy of copies) copyFileSync(join(folder, whole), copy);
    const page = await openRecording();
    const read = new Set();
    page.on('request', (request) => /\/recordings\//.test(request.url()) && read.add(request.url()));
    await page.keyboard.press('n');
    const listed = page.locator('#panel-streams li:has-text(".mcap")');
    await eventually('not all are listed', async () => (await listed.count()) > copies.length);
    await page.waitForSelector('#panel-streams li:has-text("copy-59") canvas[data-drawn]');
    const first = page.locator('#panel-streams li:has-text("copy-59") button:has-text("Show")');
    await first.focus();
    await page.evaluate(() => [...document.querySelectorAll('#panel-streams canvas[data-drawn]')].forEach((canvas) => (canvas.was = true)));
    await order('start');
    await order('stop');
    await eventually('the new one is not listed', async () => (await listed.count()) > copies.length + 1);
    assert.ok(await page.$eval('#panel-streams li:has-text("copy-59") canvas', (canvas) => canvas.was), 'its picture is made anew');
    assert.ok(await first.evaluate((button) => button === document.activeElement), 'the focus is lost');
    // The last one's comes at once, not behind all of the others'.
    await listed.last().scrollIntoViewIfNeeded();
    await listed.last().locator('canvas[data-drawn]').waitFor();
    assert.ok(read.size < copies.length / 2, `${read.size} recordings were read`);
    await page.close();
    for (const copy of copies) rmSync(copy);
  },

  async 'the button follows what somebody else records'() {
    const page = await openRecording();
    await shownPast(page, 2);
    await page.keyboard.press('n');
    const listed = page.locator('#panel-streams li:has-text(".mcap")');
    await listed.first().waitFor();
    const before = await listed.count();
    await order('start');
    await pressedIs(page, 'true');
    await order('stop');
    await pressedIs(page, 'false');
    await eventually('the open list does not have it', async () => (await listed.count()) > before);
    await page.close();
  },

  async 'what is being written plays, grows, and goes on at its end until it is whole'() {
    briefServer = await Server.start(serverPath, [...serve, '--stream', 'brief', '--record-dir', briefFolder, '--pre-roll', '1s']);
    ({ open: openBrief } = pagesOf(browser, briefServer.address, complaints));
    const page = await openBrief();
    await shownPast(page, 2);
    const before = readdirSync(briefFolder);
    await orderBrief('start');
    let file;
    await eventually('it is not listed', async () => {
      const { recordings } = await (await fetch(`${briefServer.address}/api/recordings`)).json();
      file = recordings.find((r) => r.recording && !before.includes(r.file))?.file;
      return file !== undefined;
    });
    await page.click('#tool-streams');
    await page.waitForSelector(`#panel-streams li:has-text("${file}") small:has-text("being recorded")`);
    await page.click(`#panel-streams li:has-text("${file}") button:has-text("Show")`);
    await inState(page, 'file');
    const opened = await playback(page);
    const grownBy = (times, n) =>
      page.waitForFunction((least) => window.relievo.diagnostics().playback.times.length >= least, times.length + n);

    // Paused, it grows and stays where it is.
    await page.focus('#view');
    await page.keyboard.press(' ');
    await page.waitForFunction(() => !window.relievo.diagnostics().playback.playing);
    await still(page); // one may have been on its way
    const paused = await playback(page);
    await grownBy(opened.times, 12);
    const grown = await playback(page);
    assert.deepEqual(grown.times.slice(0, opened.times.length), opened.times);
    assert.deepEqual([grown.index, grown.position, grown.playing], [paused.index, paused.position, false]);
    await page.waitForFunction((end) => Number(document.querySelector('#timeline input[type=range]').max) >= end, grown.times.at(-1));

    // Playing, it goes on with what was not there when it came to the end.
    await page.keyboard.press(' ');
    const isBehind = (end, frames) =>
      page.waitForFunction((least) => window.relievo.diagnostics().playback.index >= least, end.times.length - 1 + frames);
    const end = await playback(page);
    await page.keyboard.press('End');
    await isBehind(end, 0); // a slow page comes to what is the end now when more is there
    for (let i = 0; i < 2; ++i) {
      const now = await playback(page);
      assert.ok(now.playing, 'it waits for nothing at its end');
      await isBehind(now, 6);
    }
    const { number } = await page.evaluate(() => window.relievo.surface());
    await page.waitForFunction((n) => window.relievo.diagnostics().frame > n, number);

    // Whole, it ends.
    await orderBrief('stop');
    await page.waitForFunction(() => {
      const { playing, index, times } = window.relievo.diagnostics().playback;
      return !playing && index === times.length - 1;
    });
    const told = JSON.parse(execFileSync(relievoPath, ['info', '--json', join(briefFolder, file)], { encoding: 'utf8' }));
    const whole = await playback(page);
    assert.equal(whole.times.length, told.frames);
    assert.equal((await look(page)).errors, 0, (await look(page)).lastError);
    await page.keyboard.press('Home');
    await eventually('its beginning is not shown any more', async () => (await playback(page)).index === 0);
    await page.close();
  },

  async 'what is being written goes on beside another recording, and is repeated once it is whole'() {
    const before = readdirSync(briefFolder);
    await orderBrief('start');
    let file;
    await eventually('nothing of it can be read', async () => {
      const { recordings } = await (await fetch(`${briefServer.address}/api/recordings`)).json();
      file = recordings.find((r) => r.recording && !before.includes(r.file))?.file;
      return file !== undefined;
    });
    const web = await Server.startWeb(relievoPath, [saved, join(briefFolder, file)]);
    const { open: openBeside } = pagesOf(browser, web.address, complaints);
    const page = await openBeside('/?stream=object,brief');
    const beside = (what, n) =>
      page.waitForFunction(([key, least]) => window.relievo.diagnostics().besides[0]?.[key] >= least, [what, n]);
    await beside('shown', 1);
    const [{ frames }] = (await look(page)).besides;
    await beside('frames', frames + 12);
    await beside('index', frames + 6);
    const { index, frames: now } = (await look(page)).besides[0];
    assert.ok(index < now, 'it does not begin again while more comes');
    await orderBrief('stop');
    await page.waitForFunction((n) => window.relievo.diagnostics().besides[0].index < n, frames);
    const told = JSON.parse(execFileSync(relievoPath, ['info', '--json', join(briefFolder, file)], { encoding: 'utf8' }));
    const [{ frames: all, errors }] = (await look(page)).besides;
    assert.deepEqual([all, errors], [told.frames, 0]);
    await page.close();
    await web.kill();
  },

  async 'no error, no request to another host'() {
    // Chromium tells of what the server refuses: that it has no folder, where the list did not say so before.
    assert.deepEqual(complaints.filter((c) => !/status of 40[45]/.test(c)), []);
    assert.ok(complaints.length <= 3); // once a page, and the picture that could not be had
  },

  async 'a folder that cannot be listed is asked for again, and it is said why'() {
    const page = await openRecording();
    await page.route('**/api/recordings', (route) => route.fulfill({ status: 401, body: 'a token is needed\n' }), { times: 1 });
    await page.keyboard.press('n');
    const listed = page.locator('#panel-streams li:has-text(".mcap")');
    await listed.first().waitFor();
    const away = `${folder}-away`;
    renameSync(folder, away);
    for (const key of ['n', 'n']) await page.keyboard.press(key);
    const problem = page.locator('#panel-streams p:has-text("The folder of recordings cannot be read: No such file or directory.")');
    await problem.waitFor();
    renameSync(away, folder);
    await problem.waitFor({ state: 'hidden' });
    await listed.first().waitFor();
    await page.close();
  },

  async 'an order of which half an answer comes is said to have none, and can be given again'() {
    const page = await openRecording();
    await shownPast(page, 2);
    await page.evaluate(() => {
      const real = window.fetch;
      window.fetch = (url, init) => {
        if (init?.method !== 'POST') return real(url, init);
        window.fetch = real;
        const half = { start: (body) => init.signal.addEventListener('abort', () => body.error(init.signal.reason)) };
        return Promise.resolve(new Response(new ReadableStream(half)));
      };
    });
    await page.click('#tool-record');
    await pillSays(page, 'the server does not answer');
    await page.click('#tool-record');
    await pressedIs(page, 'true');
    await page.click('#tool-record');
    await pressedIs(page, 'false');
    await page.close();
  },

  async 'how long it records is said by the server\'s clock'() {
    for (const ahead of [3600e3, -3600e3]) {
      const page = await newRecording({ viewport: { width: 800, height: 500 } });
      await page.addInitScript((by) => {
        const { now } = Date;
        Date.now = () => now() + by;
      }, ahead);
      await page.goto(recordingServer.address);
      await shownPast(page, 2);
      await page.click('#tool-record');
      await pillSays(page, '^0:(0[2-9]|[1-5]\\d), ');
      await page.click('#tool-record');
      await pressedIs(page, 'false');
      await page.close();
    }
  },

  async 'on plain http from elsewhere what was received is saved also once the server has gone, and panels open'() {
    await recordingServer.kill(); // it is not needed any more
    const goneServer = await Server.start(serverPath, [...serve, '--stream', 'gone']);
    const page = await newRecording({ viewport: { width: 800, height: 500 } });
    await page.addInitScript(() => delete Navigator.prototype.serviceWorker); // as where nothing keeps the page
    await page.goto(goneServer.address);
    await page.waitForFunction(() => window.relievo?.diagnostics().playback?.times.length > 4);
    await page.click('#tool-record');
    await pressedIs(page, 'true');
    const parts = ['takePanel', 'streamsPanel', 'statisticsPanel', 'rangeExport', 'recordingFile', 'sample', 'cdrWriter'];
    await page.waitForFunction((all) => {
      const loaded = performance.getEntriesByType('resource').map(({ name }) => name);
      return all.every((part) => loaded.some((name) => name.includes(`/${part}-`)));
    }, parts);
    await goneServer.kill();
    await inState(page, 'lost');
    const save = async (act) => {
      const [file] = await Promise.all([page.waitForEvent('download'), act()]);
      await file.saveAs(saved);
      const told = JSON.parse(execFileSync(relievoPath, ['info', '--json', saved], { encoding: 'utf8' }));
      assert.equal(told.stream, 'gone');
      assert.ok(told.frames > 4 && told.unreadable === 0, `${told.frames} frames`);
    };
    await save(() => page.click('#tool-record'));
    await page.keyboard.press('t');
    await save(() => page.click('#panel-take button:text-is("MCAP")'));
    await page.keyboard.press('i');
    await page.waitForFunction(() => /vertices/.test(document.querySelector('#panel-statistics')?.textContent));
    await page.close();
  },

  async 'of a server that has gone it is not known whether it records, and it cannot be stopped'() {
    const page = await openBrief();
    await shownPast(page, 2);
    await page.click('#tool-record');
    await pressedIs(page, 'true');
    await pillSays(page, '^\\d+:(0[1-9]|[1-5]\\d), ');
    await briefServer.kill();
    await pillSays(page, '^Not known whether the server still records; at last \\d+:\\d\\d, ');
    await pressedIs(page, 'mixed');
    const said = await page.textContent('#recording');
    await page.waitForTimeout(2500);
    assert.equal(await page.textContent('#recording'), said, 'it counts on');
    await page.click('#tool-record');
    await pillSays(page, '^Not stopped: the server does not answer');
    await page.close();
  },
};

let failed = 1;
try {
  failed = await runChecks(checks, await open());
} finally {
  await browser.close();
  await Server.killAll();
  rmSync(scratch, { recursive: true, force: true });
}
process.exit(failed === 0 ? 0 : 1);
