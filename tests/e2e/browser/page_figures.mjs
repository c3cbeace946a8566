// SPDX-License-Identifier: Apache-2.0
// What the page costs while it streams, in headless Chromium from `relievo-server serve`: the time to the first live
// picture, tasks of the main thread, drawings while a person turns the surface, how far behind live a page is that needs 100 ms a
// frame, and memory over time.
// Run as: in_own_domain node page_figures.mjs RELIEVO_SERVER [--minutes N] [--memory] [--check], in web/viewer. Memory is
// told each half minute, of one without --minutes; --memory: nothing else is measured. --check: exit 1 where a figure that does not depend on how loaded
// the machine is falls short. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { kPatienceMs, launchChromium } from './chromium.mjs';
import { Server } from './server.mjs';

const options = process.argv.slice(2);
const [serverPath] = options;
const minutes = options.includes('--minutes') ? Number(options[options.indexOf('--minutes') + 1]) : 0.5;
const check = options.includes('--check');
const memoryAlone = options.includes('--memory');

const kSource = 'sim:object,stripes=120'; // over 20,000 vertices
const kStarts = 5;
const kTasksS = check ? 10 : 20;
const kTaskMs = 50;
const kTurnMs = check ? 3000 : 8000;
const kSlowMs = 100; // a frame
const kSlowLooks = check ? 10 : 20; // half a second apart
const kBehindMs = 300;
const kSayS = 30; // between figures of memory
const kKeptS = 65; // what is kept to go back to has its full length then
const kWorkers = ['decoder', 'stage'];
const kGrowthMB = 2; // a minute, of what is in use after a collection

const browser = await launchChromium(['--js-flags=--expose-gc', '--enable-precise-memory-info']);
const server = await Server.start(serverPath, ['--source', kSource, '--decoder', 'quick']);
const median = (values) => [...values].sort((a, b) => a - b)[Math.floor(values.length / 2)];
const ms = (value) => `${value.toFixed(0)} ms`;
const shownPast = (page, count) =>
  page.waitForFunction((least) => window.relievo?.diagnostics().shown >= least, count, { polling: 20 });
const report = (page) => page.evaluate(() => window.relievo.diagnostics());
const failures = [];
const expect = (condition, what) => condition || failures.push(what);

async function open(path = '/', script = null, viewport = { width: 800, height: 500 }) {
  const page = await browser.newPage({ viewport });
  page.setDefaultTimeout(kPatienceMs);
  if (script !== null) await page.addInitScript(script);
  await page.goto(server.address + path);
  return page;
}

/** From the moment the page was asked for until a surface was drawn; nothing is kept from one to the next. */
async function starts() {
  const watch = () => {
    const look = () => {
      if (window.relievo?.diagnostics().shown >= 1) window.firstPictureMs ??= performance.now();
      else requestAnimationFrame(look);
    };
    requestAnimationFrame(look);
  };
  const [first, script] = [[], []];
  for (let i = 0; i < kStarts; ++i) {
    const page = await open('/', watch);
    await page.waitForFunction(() => window.firstPictureMs !== undefined);
    first.push(await page.evaluate(() => window.firstPictureMs));
    script.push(await page.evaluate(() => performance.getEntriesByType('navigation')[0].domInteractive));
    await page.context().close();
  }
  console.log(`first live picture: ${ms(median(first))} (${first.map((t) => t.toFixed(0)).join(', ')}); the document alone: ${ms(median(script))}`);
}

/** Tasks of the page's main thread while it streams: by the clock, and by the processor time they took. */
async function tasks() {
  const page = await open();
  await shownPast(page, 20);
  const tracing = await browser.newBrowserCDPSession();
  const events = [];
  tracing.on('Tracing.dataCollected', ({ value }) => events.push(...value));
  const complete = new Promise((resolve) => tracing.once('Tracing.tracingComplete', resolve));
  await tracing.send('Tracing.start', {
    transferMode: 'ReportEvents',
    traceConfig: { includedCategories: ['toplevel', 'devtools.timeline', 'v8', 'disabled-by-default-devtools.timeline'] },
  });
  const before = await report(page);
  await page.waitForTimeout(kTasksS * 1000);
  const after = await report(page);
  await tracing.send('Tracing.end');
  await complete;
  const mains = events.filter((e) => e.name === 'thread_name' && e.args.name === 'CrRendererMain');
  const isMain = (e) => mains.some((m) => m.pid === e.pid && m.tid === e.tid);
  const all = events.filter((e) => e.ph === 'X' && e.tdur !== undefined && isMain(e));
  // The trace alone says it: the page's own observer also counts what starting and ending the trace holds up.
  const byStart = all.filter((e) => /RunTask$/.test(e.name)).sort((a, b) => a.ts - b.ts || b.dur - a.dur);
  let end = -Infinity; // of the task before: what lies in it is a part of it
  const tasksOf = byStart.filter((e) => e.ts >= end && ((end = e.ts + e.dur), true));
  const run = tasksOf.sort((a, b) => b.tdur - a.tdur);
  const long = run.filter((e) => e.dur > kTaskMs * 1000);
  assert.ok(run.length > 100, `${run.length} tasks in the trace`);
  const [worst] = run;
  const clock = Math.max(0, ...run.map((e) => e.dur));
  console.log(`${after.vertices} vertices, ${((after.shown - before.shown) / kTasksS).toFixed(1)} frames a second for ${kTasksS} s, ${run.length} tasks`);
  console.log(`  the longest by the clock ${ms(clock / 1000)}, by processor time ${(worst.tdur / 1000).toFixed(1)} ms; over ${kTaskMs} ms by the clock: ${long.length}`);
  const [slowest] = [...run].sort((a, b) => b.dur - a.dur);
  for (const [task, what] of [[worst, 'processor'], [slowest, 'clock']]) {
    const inside = all.filter((e) => e.pid === task.pid && e !== task && e.ts >= task.ts && e.ts + e.dur <= task.ts + task.dur && !/RunTask$/.test(e.name));
    const parts = inside.sort((a, b) => b.dur - a.dur).slice(0, 5).map((e) => `${e.name} ${(e.dur / 1000).toFixed(1)} (${(e.tdur / 1000).toFixed(1)})`);
    console.log(`    in the longest by the ${what}, ms by the clock (and of the processor): ${(task.dur / 1000).toFixed(1)} (${(task.tdur / 1000).toFixed(1)}): ${parts.join(', ')}`);
  }
  expect(after.vertices >= 20_000, `only ${after.vertices} vertices`);
  expect(worst.tdur < kTaskMs * 1000, `a task took ${worst.tdur / 1000} ms of the processor`);
  await page.context().close();
}

/** Drawings a second while the mouse turns the surface, as it streams and at rest: here the processor draws. */
async function turning() {
  const page = await open();
  await shownPast(page, 20);
  const whole = await browser.newBrowserCDPSession();
  /** Seconds of the processor so far. */
  const spent = async () => {
    const { processInfo } = await whole.send('SystemInfo.getProcessInfo');
    const of = (wanted) => processInfo.filter(({ type }) => type === wanted).reduce((sum, { cpuTime }) => sum + cpuTime, 0);
    return { page: of('renderer'), graphics: of('GPU') };
  };
  const turned = async () => {
    const [before, spentBefore] = [await report(page), await spent()];
    const begin = Date.now();
    await page.mouse.move(300, 200);
    await page.mouse.down();
    for (let i = 0; Date.now() - begin < kTurnMs; ++i) await page.mouse.move(300 + 20 * Math.cos(i / 20), 200 + 20 * Math.sin(i / 20));
    await page.mouse.up();
    const [after, spentAfter] = [await report(page), await spent()];
    const rate = (name) => (((after[name] - before[name]) * 1000) / (Date.now() - begin)).toFixed(1);
    const each = (of) => (((spentAfter[of] - spentBefore[of]) * 1000) / (after.drawn - before.drawn)).toFixed(1);
    return { drawn: rate('drawn'), shown: rate('shown'), page: each('page'), graphics: each('graphics') };
  };
  const live = await turned();
  await page.keyboard.press(' ');
  const atRest = await turned();
  console.log(`turned by hand: ${live.drawn} drawings a second, of ${live.shown} frames; of one frame ${atRest.drawn}, for which the page and its workers take ${atRest.page} ms of the processor each, and what draws in place of a graphics card ${atRest.graphics}`);
  await page.context().close();
}

/** A page whose every drawing takes 100 ms: since publication, by the server's clock. */
async function slowPage() {
  const slow = (kMs) => {
    const original = window.requestAnimationFrame.bind(window);
    window.requestAnimationFrame = (act) =>
      original((now) => {
        for (const end = performance.now() + kMs; performance.now() < end; );
        act(now);
      });
  };
  const page = await open('/', `(${slow})(${kSlowMs})`);
  await shownPast(page, 20);
  const behind = async () => {
    const { stages, latencyMs } = await report(page);
    return { since: stages.gateway + stages.network + stages.decode + stages.draw, exposure: latencyMs };
  };
  const seen = [];
  const before = await report(page);
  const begin = Date.now();
  for (let i = 0; i < kSlowLooks; ++i) {
    await page.waitForTimeout(500);
    seen.push(await behind());
  }
  const after = await report(page);
  const rate = ((after.shown - before.shown) * 1000) / (Date.now() - begin);
  const since = median(seen.map((s) => s.since));
  const intervals = since / (1000 / rate); // a loaded machine makes each frame dearer, and nothing waits longer for it
  console.log(`a page that needs ${kSlowMs} ms a frame: ${ms(since)} behind what is published, ${ms(median(seen.map((s) => s.exposure)))} behind the exposure, ${rate.toFixed(1)} frames a second: ${intervals.toFixed(2)} frames behind`);
  expect(rate < 1000 / kSlowMs, `the slow page draws ${rate} frames a second`);
  expect(intervals < kBehindMs / kSlowMs, `the slow page is ${intervals} frames behind`);
  await page.context().close();
}

/** Asks each worker of the page's session, as the protocol knows them: they are targets of their own. */
async function workersOf(session) {
  const found = new Map(); // session id -> the worker's file
  const waiting = new Map();
  let last = 0;
  session.on('Target.attachedToTarget', ({ sessionId, targetInfo }) => found.set(sessionId, /([a-z]+)[^/]*$/i.exec(targetInfo.url)?.[1] ?? targetInfo.url));
  session.on('Target.detachedFromTarget', ({ sessionId }) => found.delete(sessionId));
  session.on('Target.receivedMessageFromTarget', ({ message }) => {
    const { id, result } = JSON.parse(message);
    waiting.get(id)?.(result);
    waiting.delete(id);
  });
  await session.send('Target.setAutoAttach', { autoAttach: true, waitForDebuggerOnStart: false, flatten: false });
  const ask = (sessionId, method) =>
    new Promise((resolve) => {
      const id = ++last;
      waiting.set(id, resolve);
      session.send('Target.sendMessageToTarget', { sessionId, message: JSON.stringify({ id, method }) });
    });
  return async () => {
    const heaps = {};
    for (const [sessionId, name] of found) {
      await ask(sessionId, 'HeapProfiler.enable');
      await ask(sessionId, 'HeapProfiler.collectGarbage');
      const { usedSize, backingStorageSize = 0 } = await ask(sessionId, 'Runtime.getHeapUsage');
      heaps[name] = { heap: usedSize / 1e6, buffers: backingStorageSize / 1e6 };
    }
    return heaps;
  };
}

/** What page and workers hold after a collection, and the page's process; the start is when all that is kept is full. */
async function memory() {
  const page = await open();
  await shownPast(page, 1);
  const session = await page.context().newCDPSession(page);
  const whole = await browser.newBrowserCDPSession();
  const workers = await workersOf(session);
  await session.send('HeapProfiler.enable');
  const usage = async () => {
    await session.send('HeapProfiler.collectGarbage');
    const heap = await session.send('Runtime.getHeapUsage');
    const { processInfo } = await whole.send('SystemInfo.getProcessInfo');
    const resident = processInfo
      .filter(({ type }) => type === 'renderer')
      .map(({ id }) => Number(/VmRSS:\s+(\d+)/.exec(readFileSync(`/proc/${id}/status`, 'utf8'))?.[1] ?? 0) / 1000);
    const { keptBytes } = await report(page);
    return { workers: await workers(), kept: keptBytes / 1e6, heap: heap.usedSize / 1e6, buffers: (heap.backingStorageSize ?? 0) / 1e6, resident: Math.max(...resident) };
  };
  const both = ({ heap, buffers }) => `${heap.toFixed(2)} MB and ${buffers.toFixed(1)} MB`;
  const line = (u) => `heap ${u.heap.toFixed(2)} MB, its buffers ${u.buffers.toFixed(1)} MB, ${u.kept.toFixed(1)} of it kept to go back to, process ${u.resident.toFixed(0)} MB; ${Object.entries(u.workers).map(([name, w]) => `${name} ${both(w)}`).join(', ')}`;
  // Until what is kept has its length, its buffers grow as they should; the objects that hold them are few.
  const warm = minutes >= 3 ? kKeptS : 10;
  await page.waitForTimeout(warm * 1000);
  const start = await usage();
  console.log(`memory after ${warm} s: ${line(start)}`);
  const heaps = [start.heap];
  let end = start;
  for (let s = kSayS; s <= minutes * 60; s += kSayS) {
    await page.waitForTimeout(kSayS * 1000);
    end = await usage();
    heaps.push(end.heap);
    console.log(`  ${s} s later, ${(await report(page)).shown} frames: ${line(end)}`);
  }
  console.log(`  the heap's least and most: ${Math.min(...heaps).toFixed(2)}, ${Math.max(...heaps).toFixed(2)} MB`);
  const growth = (end.heap - start.heap) / minutes;
  console.log(`  the heap grows by ${growth.toFixed(2)} MB a minute`);
  expect(growth < kGrowthMB, `the heap grows by ${growth} MB a minute`);
  expect(kWorkers.every((name) => name in end.workers), `workers: ${Object.keys(end.workers)}`);
  for (const [name, { heap }] of Object.entries(end.workers)) {
    const grown = (heap - (start.workers[name]?.heap ?? 0)) / minutes;
    console.log(`  that of the worker ${name} by ${grown.toFixed(2)} MB a minute`);
    expect(grown < kGrowthMB, `the heap of the worker ${name} grows by ${grown} MB a minute`);
  }
  await page.context().close();
}

try {
  if (!memoryAlone) {
    await starts();
    await tasks();
    await turning();
    await slowPage();
  }
  await memory();
} finally {
  await browser.close();
  await server.kill();
}
for (const failure of failures) console.log(`short: ${failure}`);
process.exit(check && failures.length > 0 ? 1 : 0);
