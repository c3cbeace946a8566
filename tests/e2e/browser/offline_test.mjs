// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium: the page can be installed; without its server it opens and shows files of the device;
// it keeps its own files alone, and nothing of what a token opens; a new version takes over at the next load.
// Run as: in_own_domain node offline_test.mjs RELIEVO_SERVER RELIEVO VIEWER_DIST, in web/viewer. Exit 77: no Chromium.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { cpSync, mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { tmpdir } from 'node:os';
import { extname, join } from 'node:path';
import { eventually, kPatienceMs, launchChromium } from './chromium.mjs';
import { inState, look, runChecks, shownPast, still } from './feeder.mjs';
import { recordObject } from './recorded.mjs';
import { startWeb } from './web.mjs';

const [serverPath, relievoPath, dist] = process.argv.slice(2);
const kToken = 'a-token-for-this-test';

const scratch = mkdtempSync(join(tmpdir(), 'relievo-offline-'));
const recorded = recordObject(serverPath, join(scratch, 'object.mcap'), { rate: 6, frames: 5 });
const surfaces = { ply: ['ply'], glb: ['glb'], draco: ['glb', '--draco'] };
for (const [name, format] of Object.entries(surfaces)) {
  execFileSync(relievoPath, ['export', recorded, '--out', join(scratch, name), '--format', ...format], { stdio: 'ignore' });
}
const exported = (name) =>
  join(scratch, name, readdirSync(join(scratch, name)).filter((file) => file.endsWith(surfaces[name][0])).sort()[2]);
const tokens = join(scratch, 'tokens');
writeFileSync(tokens, `${kToken}\n`, { mode: 0o600 });

/** Until the page opens without its server, and this page's requests go through the service worker. */
const ready = (page) =>
  page.waitForFunction(async () => (await navigator.serviceWorker.ready) && navigator.serviceWorker.controller !== null);
const kept = (page) =>
  page.evaluate(async () => {
    const found = {};
    for (const name of await caches.keys()) {
      for (const request of await (await caches.open(name)).keys()) {
        const response = await (await caches.open(name)).match(request);
        found[`${name} ${request.url}`] = { status: response.status, text: await response.text(), url: request.url };
      }
    }
    return found;
  });
/** As a person does: the page handles what is dropped. */
const drop = (page, path, name) =>
  page.evaluate(
    ([data, file]) => {
      const transfer = new DataTransfer();
      transfer.items.add(new File([Uint8Array.from(atob(data), (c) => c.charCodeAt(0))], file));
      for (const type of ['dragover', 'drop']) {
        document.body.dispatchEvent(new DragEvent(type, { dataTransfer: transfer, bubbles: true, cancelable: true }));
      }
    },
    [readFileSync(path).toString('base64'), name],
  );

/** The built page at an address, as any server of files gives it. */
class Files {
  static async start(folder, port = 0) {
    const types = { '.html': 'text/html', '.js': 'text/javascript', '.css': 'text/css', '.wasm': 'application/wasm', '.svg': 'image/svg+xml' };
    const files = new Files();
    files.server = createServer((request, response) => {
      const path = request.url.split('?')[0];
      try {
        const file = path === '/' ? 'index.html' : path;
        const body = readFileSync(join(folder, file));
        const type = types[extname(file)] ?? 'application/octet-stream';
        response.writeHead(200, { 'content-type': type, 'cache-control': 'no-cache' });
        response.end(body);
      } catch {
        response.writeHead(404).end();
      }
    });
    await new Promise((resolve, reject) => files.server.once('error', reject).listen(port, '127.0.0.1', resolve));
    files.port = files.server.address().port;
    return files;
  }
  async stop() {
    const closed = new Promise((resolve) => this.server.close(resolve));
    this.server.closeAllConnections();
    await closed;
  }
}

const browser = await launchChromium();
const context = await browser.newContext({ viewport: { width: 800, height: 500 } });
const web = await startWeb(relievoPath, recorded, ['--token-file', tokens]);

const checks = {
  async 'it can be installed'(page) {
    await page.goto(web.address);
    await page.fill('input[name=token]', kToken);
    await page.click('button');
    await inState(page, 'file');
    await ready(page);
    const devtools = await context.newCDPSession(page);
    const { data, errors } = await devtools.send('Page.getAppManifest');
    assert.deepEqual(errors, []);
    assert.equal(JSON.parse(data).name, 'Relievo');
    const { installabilityErrors } = await devtools.send('Page.getInstallabilityErrors');
    // A context of its own is what Chromium calls incognito.
    assert.deepEqual(installabilityErrors.filter(({ errorId }) => errorId !== 'in-incognito'), []);
    const icons = await page.evaluate(async () => {
      const address = document.querySelector('link[rel=manifest]').href;
      const { icons: listed } = await (await fetch(address)).json();
      return Promise.all(
        listed.map(async ({ src, sizes, type }) => {
          const blob = await (await fetch(new URL(src, address))).blob();
          const png = type === 'image/png' ? await createImageBitmap(blob) : null;
          return { sizes, type, is: blob.type, has: png === null ? 'any' : `${png.width}x${png.height}` };
        }),
      );
    });
    for (const { sizes, type, is, has } of icons) assert.deepEqual([sizes, type], [has, is]);
    assert.deepEqual(icons.map(({ sizes }) => sizes), ['any', '192x192', '512x512', '512x512']);
  },

  async 'it keeps its own files alone, whatever it shows'(page) {
    await shownPast(page, 2);
    const files = await kept(page);
    const own = readdirSync(dist, { recursive: true, withFileTypes: true }).filter((e) => e.isFile() && e.name !== 'sw.js');
    assert.equal(Object.keys(files).length, own.length, Object.keys(files).join('\n'));
    for (const [name, { status, text, url }] of Object.entries(files)) {
      assert.equal(status, 200, name);
      assert.ok(!/\/api\/|\/recordings\/|\/ws\/|token=/.test(url), url);
      assert.ok(!text.includes(kToken) && !text.includes('name="token"'), name);
    }
  },

  async 'a person whose token is gone is asked for it'(page) {
    await context.clearCookies();
    await page.reload();
    await page.waitForSelector('input[name=token]');
    await page.fill('input[name=token]', kToken);
    await page.click('button');
    await inState(page, 'file');
    assert.equal(page.url(), web.address);
  },

  async 'without its server it opens, and says that there is none'(page) {
    await web.stop();
    await page.reload();
    await inState(page, 'lost');
    assert.equal(await page.title(), 'Relievo');
    assert.match(await page.textContent('#card'), /of this device/);
    await page.goto(`${web.address}?stream=object`);
    await page.waitForFunction(() => window.relievo !== undefined);
  },

  async 'a recording, a PLY and GLBs of the device, with Draco too, are shown without a server'(page) {
    await drop(page, recorded, 'object.mcap');
    await shownPast(page, 1);
    await inState(page, 'file');
    await page.waitForFunction(() => !window.relievo.diagnostics().playback.playing);
    await still(page);
    assert.equal((await look(page)).errors, 0);
    assert.ok((await look(page)).pixels.covered > 0.1);
    for (const [name, [ending]] of Object.entries(surfaces)) {
      await drop(page, exported(name), `${name}.${ending}`);
      await page.waitForFunction((file) => window.relievo.diagnostics().file === file, `${name}.${ending}`);
      await still(page);
      const { pixels, vertices } = await look(page);
      assert.ok(pixels.covered > 0.1 && pixels.deviation > 5, `${name}: ${JSON.stringify(pixels)}, ${vertices}`);
    }
  },

  async 'a new version takes over at the next load'() {
    const [before, after] = ['before', 'after'].map((name) => join(scratch, name));
    cpSync(dist, before, { recursive: true });
    cpSync(dist, after, { recursive: true });
    const change = (file, from, to) => {
      const text = readFileSync(join(after, file), 'utf8');
      assert.ok(text.includes(from), `${file} has no ${from}`);
      writeFileSync(join(after, file), text.replaceAll(from, to));
    };
    change('index.html', 'name="description" content="', 'name="description" content="New: ');
    change('sw.js', /"([0-9a-f]{16})"/.exec(readFileSync(join(after, 'sw.js'), 'utf8'))[1], '0123456789abcdef');
    const isNew = (page) => page.evaluate(() => document.querySelector('meta[name=description]').content.startsWith('New: '));

    let files = await Files.start(before);
    const { port } = files;
    const page = await context.newPage();
    page.setDefaultTimeout(kPatienceMs);
    await page.goto(`http://127.0.0.1:${port}/`);
    await ready(page);
    assert.equal(await isNew(page), false);
    await files.stop();
    await eventually(`port ${port} does not become free`, () => Files.start(after, port).then((f) => (files = f)).catch(() => false));
    await page.reload();
    assert.equal(await isNew(page), true);
    await eventually('the old version is still kept', async () => {
      const names = await page.evaluate(() => caches.keys());
      return names.length === 1 && names[0] === 'relievo-page-0123456789abcdef';
    });
    await files.stop();
    await page.reload();
    assert.equal(await isNew(page), true);
    await page.close();
  },
};

let failed = 1;
try {
  const page = await context.newPage();
  page.setDefaultTimeout(kPatienceMs);
  failed = await runChecks(checks, page);
} finally {
  await browser.close();
  await web.stop();
  rmSync(scratch, { recursive: true, force: true });
}
process.exit(failed === 0 ? 0 : 1);
