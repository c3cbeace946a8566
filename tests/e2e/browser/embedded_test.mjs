// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium, of <relievo-player> in pages that treat it as they treat any element: set before it is defined,
// driven before it has frames, moved, emptied, in many numbers, from another site, with a token, with what cannot work.
// Run as: in_own_domain node embedded_test.mjs RELIEVO_SERVER PACKAGE, in web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdirSync, mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { eventually, kPatienceMs, launchChromium } from './chromium.mjs';
import { countFrames, hangingDecoders, kHide, kShow, moveOut, turned } from './embedded_page.mjs';
import { recordObject } from './recorded.mjs';
import { Server } from './server.mjs';
import { packed, player, serveSite, shot } from './site.mjs';
import { withoutWebGl } from './web.mjs';

const [serverPath, packagePath] = process.argv.slice(2);
const kToken = 'a-token-for-this-test';
const kSource = 'sim:object,width=320,height=240,stripes=60,rate=6';
const scratch = mkdtempSync(join(tmpdir(), 'relievo-embedded-'));
const site = join(scratch, 'site');
mkdirSync(site);
packed(packagePath, scratch);
execFileSync('cp', ['-r', join(scratch, 'package'), join(site, 'relievo-player')]);
const page_ = (body, script = 'relievo-player/dist/relievo-player.js') => `<!doctype html><title>Another site</title>${body}<script type="module" src="${script}"></script>`;
writeFileSync(join(site, 'page.html'), page_('<relievo-player controls></relievo-player>'));
writeFileSync(join(site, 'early.js'), `const early = document.querySelector('relievo-player');
Object.assign(early, { src: 'take.mcap', mode: 'depth', controls: true, currentTime: 1 });
early.after(document.createElement('output'));
`);
writeFileSync(join(site, 'early.html'), page_('<relievo-player></relievo-player><script src="early.js"></script>'));
const kFrames = 13;
recordObject(serverPath, join(site, 'take.mcap'), { rate: 6, frames: kFrames, options: ['--stream', 'take', '--key-interval', '5'] });
const web = await serveSite(site, { 'access-control-allow-origin': '*' });
const lax = await serveSite(site, { 'content-security-policy': "object-src 'none'" }); // takes scripts of any site
const { port } = web.address();
const origin = `http://127.0.0.1:${port}`;
const foreign = `http://localhost:${port}`; // another site than the gateways', so that no cookie of theirs goes along
writeFileSync(join(site, 'elsewhere.html'), page_('<relievo-player src="take.mcap"></relievo-player>', `${origin}/relievo-player/dist/relievo-player.js`));
const tokens = join(scratch, 'tokens');
writeFileSync(tokens, `${kToken}\n`, { mode: 0o600 });
const folder = join(scratch, 'folder');
mkdirSync(folder);
const allowed = ['--allow-origin', origin, '--allow-origin', foreign];
const rig = await Server.start(serverPath, ['--source', kSource, '--key-interval', '5', '--record-dir', folder, ...allowed]);
const browser = await launchChromium();
const complaints = [];

async function newPage(path = '/page.html', { at = origin, before } = {}) {
  const page = await browser.newPage({ viewport: { width: 720, height: 560 } });
  page.setDefaultTimeout(kPatienceMs);
  page.on('pageerror', (error) => complaints.push(`page error: ${error.message}`));
  page.on('console', (message) => {
    if (message.type() === 'error') complaints.push(`console: ${message.text()}`);
  });
  await before?.(page);
  await page.goto(at + path);
  return page;
}

const when = async (page, condition) => {
  const holds = () => player(page, condition);
  await eventually(`not: ${condition}`, holds).catch(async (error) => {
    throw new Error(`${error.message}, but ${JSON.stringify(await player(page, (p) => [p.state, p.message, p.duration, p.currentTime]))}`);
  });
};
const set = (page, properties) => page.evaluate((all) => void Object.assign(document.querySelector('relievo-player'), all), properties);
/** Opaque share of what the player shows. */
const opaque = async (page) => (await shot(page)).opaque;
/** What is said in the player, where it matches. */
const says = (page, what) => eventually(`it does not say ${what}`, async () => what.test(await page.textContent('relievo-player .message')));
/** With a page of its own, which is closed behind it. */
const on = (path, options, check) => async () => {
  const page = await newPage(path, options);
  await check(page);
  await page.close();
};

const publishedOf = async ({ address }) => (await (await fetch(`${address}/api/streams`)).json()).streams[0]?.status?.frames_published ?? 0;

const checks = {
  'what a page sets before the element is defined holds': on('/early.html', {}, async (page) => {
    await when(page, (p) => p.state === 'file' && p.getAttribute('mode') === 'depth' && p.controls);
    await when(page, (p) => p.currentTime >= 1);
    await set(page, { mode: 'normals' });
    assert.equal(await player(page, (p) => p.getAttribute('mode')), 'normals');
  }),

  'what a page asks for right after src holds': on('/page.html', {}, async (page) => {
    const said = await page.evaluate(() => {
      const element = document.querySelector('relievo-player');
      element.src = 'take.mcap';
      element.pause();
      Object.assign(element, { currentTime: 1, playbackRate: 0.5 });
      return [element.paused, element.currentTime, element.playbackRate];
    });
    assert.deepEqual(said, [true, 1, 0.5]);
    await when(page, (p) => p.state === 'file' && p.duration > 1);
    assert.deepEqual(await player(page, (p) => [p.paused, p.currentTime, p.playbackRate]), said);
    await page.evaluate((src) => {
      const element = document.querySelector('relievo-player');
      element.src = src;
      element.pause();
    }, `${rig.address}/?stream=object`);
    await when(page, (p) => p.state === 'behind' && p.paused);
    // The next src begins as any.
    await set(page, { src: 'take.mcap' });
    await when(page, (p) => p.state === 'file' && p.paused && p.currentTime === p.duration);
  }),

  'what is no number is refused, as by <video>': on('/page.html', {}, async (page) => {
    await set(page, { src: 'take.mcap' });
    await when(page, (p) => p.state === 'file');
    for (const name of ['currentTime', 'playbackRate']) {
      const threw = await page.evaluate((of) => {
        try {
          document.querySelector('relievo-player')[of] = NaN;
        } catch (error) {
          return error instanceof TypeError;
        }
        return false;
      }, name);
      assert.ok(threw, name);
    }
    assert.ok(await player(page, (p) => p.currentTime >= 0 && p.playbackRate === 1));
  }),

  'moved in the page, also into a shadow, it goes on where it was': on('/page.html', {}, async (page) => {
    await set(page, { src: `${rig.address}/?stream=object` });
    await when(page, (p) => p.state === 'live' && p.duration > 1);
    await page.evaluate(() => document.querySelector('relievo-player').pause());
    await when(page, (p) => p.state === 'behind' && p.paused);
    const before = await player(page, (p) => [p.state, p.paused, p.shadowRoot.querySelector('.view') === (window.canvas_ = p.shadowRoot.querySelector('.view'))]);
    const moved = await page.evaluate(async () => {
      const element = document.querySelector('relievo-player');
      const host = document.body.appendChild(document.createElement('div'));
      host.attachShadow({ mode: 'open' }).append(element);
      await new Promise((resolve) => setTimeout(resolve));
      document.body.prepend(element);
      return [element.state, element.paused, element.shadowRoot.querySelector('.view') === window.canvas_];
    });
    assert.deepEqual(moved, before);
    assert.ok((await opaque(page)) > 0.15);
    await page.evaluate(() => document.querySelector('relievo-player').goLive());
    await when(page, (p) => p.state === 'live');
  }),

  'moved into another document, as into a window of its own, it looks and shows as before': on('/page.html', {}, async (page) => {
    const styled = (of) => page.evaluate(`(() => {
      const { shadowRoot } = ${of};
      const style = (e) => { const { position, width, color, borderRadius } = getComputedStyle(e); return [position, width, color, borderRadius]; };
      return [shadowRoot.host, shadowRoot.querySelector('.view'), shadowRoot.querySelector('#timeline')].map(style);
    })()`);
    await page.evaluate(() => {
      window.moved_ = document.querySelector('relievo-player');
      Object.assign(window.moved_, { src: 'take.mcap' }).style.width = '280px';
    });
    await when(page, (p) => p.state === 'file');
    const before = await styled('window.moved_');
    await page.evaluate(() => document.body.appendChild(document.createElement('iframe')).contentDocument.body.append(window.moved_));
    await page.waitForFunction(() => window.moved_.state === 'file');
    assert.deepEqual(await styled('window.moved_'), before);
  }),

  'in a window of its own it goes on while the page that it came from is in the background': on('/page.html', {}, async (page) => {
    await set(page, { src: 'take.mcap', loop: true });
    await when(page, (p) => p.state === 'file');
    const popup = await moveOut(page);
    await popup.waitForFunction((frames) => opener.frames_.length > frames, 2 * kFrames); // twice around
    assert.equal(await page.evaluate(() => window.moved_.state), 'file');
    const size = () => page.evaluate(() => window.moved_.screenshot().then((blob) => createImageBitmap(blob)).then(({ width }) => width));
    const before = await size();
    await page.evaluate(() => (window.moved_.style.width = '200px'));
    await eventually('its picture keeps its size', async () => (await size()) < before);
    await popup.close();
  }),

  'there a live stream comes back after a lost connection, and its time line goes on': on('/page.html', {}, async (page) => {
    await page.evaluate(() => {
      window.sockets_ = [];
      window.WebSocket = class extends WebSocket {
        constructor(...of) {
          super(...of);
          window.sockets_.push(this);
        }
      };
    });
    await set(page, { src: `${rig.address}/?stream=object`, controls: true });
    await when(page, (p) => p.state === 'live');
    const popup = await moveOut(page);
    await popup.waitForFunction(() => opener.moved_.state === 'live' && opener.frames_.length > 2);
    const before = await popup.evaluate(() => {
      opener.sockets_.at(-1).close();
      return opener.sockets_.length;
    });
    await popup.waitForFunction((count) => opener.sockets_.length > count, before);
    await popup.waitForFunction(() => opener.moved_.state === 'live');
    const end = () => Number(opener.moved_.shadowRoot.querySelector('#timeline input').max);
    const reached = await popup.evaluate(end);
    await popup.waitForFunction((at) => Number(opener.moved_.shadowRoot.querySelector('#timeline input').max) > at, reached);
    await popup.close();
  }),

  'there a decoder that hangs is replaced': on('/page.html', { before: hangingDecoders }, async (page) => {
    await set(page, { src: `${rig.address}/?stream=object` });
    await when(page, (p) => p.state === 'live');
    const popup = await moveOut(page);
    await popup.waitForFunction(() => opener.frames_.length > 2);
    await popup.evaluate(() => (opener.hang_ = true));
    await popup.waitForFunction(() => !opener.hang_); // another one was started
    const before = await popup.evaluate(() => opener.frames_.length);
    await popup.waitForFunction((count) => opener.frames_.length > count, before);
    await popup.close();
  }),

  'without a src, or with one that fails, nothing of before is seen': on('/page.html', {}, async (page) => {
    for (const src of ['', 'there-is-none.mcap']) {
      await set(page, { src: 'take.mcap' });
      await when(page, (p) => p.state === 'file');
      await eventually('there is no picture', async () => (await opaque(page).catch(() => 0)) > 0.15);
      await set(page, { src });
      const nothing = await page.evaluate(() => document.querySelector('relievo-player').screenshot().then(() => false, () => true));
      assert.ok(nothing, `the picture of before is there with "${src}"`);
    }
    await says(page, /is not there/);
  }),

  'a gateway\'s address of a recording, and the quality of an address': on('/page.html', {}, async (page) => {
    const order = (action) =>
      fetch(`${rig.address}/api/recording/object`, { method: 'POST', body: JSON.stringify({ action }), headers: { 'content-type': 'application/json' } });
    const state = async () => (await fetch(`${rig.address}/api/recording/object`)).json();
    assert.ok((await order('start')).ok);
    await eventually('nothing is recorded', async () => (await state()).frames > 6);
    assert.ok((await order('stop')).ok);
    const listed = async () => (await (await fetch(`${rig.address}/api/recordings`)).json()).recordings[0];
    await eventually('the recording does not end', async () => (await listed())?.recording === false);
    const { file } = await listed();
    await set(page, { src: `${rig.address}/?recording=${file}` });
    await when(page, (p) => p.state === 'file' && p.duration > 0.3);
    const asked = page.waitForEvent('websocket').then((socket) => socket.waitForEvent('framesent', ({ payload }) => /"want":"reduced"/.test(payload)));
    await set(page, { src: `${rig.address}/?stream=object&quality=reduced` });
    await asked;
    await when(page, (p) => p.state === 'live');
  }),

  'a gateway that wants a token says so, and takes one from src': on('/page.html', { at: foreign }, async (page) => {
    const guarded = await Server.start(serverPath, ['--source', kSource, '--key-interval', '5', '--stream', 'guarded', '--token-file', tokens, ...allowed]);
    await set(page, { src: `${guarded.address}/?stream=guarded` });
    await says(page, /token/i);
    assert.equal(await player(page, (p) => p.state), 'failed');
    await set(page, { src: `${guarded.address}/?stream=guarded&token=${kToken}` });
    await when(page, (p) => p.state === 'live');
    await guarded.kill();
  }),

  'what cannot be shown says why': on('/page.html', {}, async (page) => {
    await set(page, { src: 'http://' });
    await says(page, /src” is no address/);
    await set(page, { src: `${rig.address}/?stream=one,two` });
    await says(page, /No stream can have the name/);
    assert.equal(await player(page, (p) => p.state), 'failed');
    await page.evaluate(() => {
      window.told_ = [];
      const line = document.querySelector('relievo-player').shadowRoot.querySelector('.message');
      const say = () => line.getAttribute('aria-live') !== 'off' && window.told_.push(line.textContent);
      new MutationObserver(say).observe(line, { childList: true });
    });
    for (const src of ['http://127.0.0.1:9/?stream=object', 'http://127.0.0.1:9/recordings/take.mcap']) {
      await set(page, { src });
      await says(page, /does not answer, or does not let pages of this site in/);
      if (/stream/.test(src)) await says(page, /again in [34] s/); // the third attempt
    }
    const told = await page.evaluate(() => window.told_.filter((words) => /does not answer/.test(words)));
    assert.ok(told.length <= 2, `who listens hears of each second: ${told.join(' | ')}`);
  }),

  'files of another site: it says that they must be of the page\'s own': on('/elsewhere.html', { at: `http://127.0.0.1:${lax.address().port}` }, async (page) => {
    await says(page, /files must come from the page's own site/);
    assert.doesNotMatch(await page.textContent('relievo-player .message'), /WebGL/);
  }),

  'without WebGL 2 it says that': on('/page.html', { before: withoutWebGl }, (page) => says(page, /no WebGL 2/)),

  'a picture that the graphics driver takes away is told of, and comes back': on('/page.html', {
    before: (page) => page.addInitScript(() => {
      delete window.OffscreenCanvas; // the page itself draws, and its context can be had
      const original = HTMLCanvasElement.prototype.getContext;
      HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
        const context = original.call(this, kind, ...rest);
        if (this.isConnected === false && this.className === 'view') return context;
        if (this.className === 'view') window.loses_ = context.getExtension('WEBGL_lose_context');
        return context;
      };
    }),
  }, async (page) => {
    await set(page, { src: 'take.mcap' });
    await when(page, (p) => p.state === 'file');
    await page.waitForFunction(() => window.loses_);
    await page.evaluate(() => window.loses_.loseContext());
    await says(page, /driver took the picture away/);
    assert.equal(await player(page, (p) => p.state), 'failed');
    await page.evaluate(() => window.loses_.restoreContext());
    await when(page, (p) => p.state === 'file' && p.message === '');
  }),

  'a picture that is being taken when it goes is given up': on('/page.html', {}, async (page) => {
    await set(page, { src: 'take.mcap' });
    await when(page, (p) => p.state === 'file');
    await eventually('there is no picture', async () => (await opaque(page).catch(() => 0)) > 0.15);
    const settled = await page.evaluate(() => {
      const element = document.querySelector('relievo-player');
      const taken = element.screenshot().then(() => 'taken', () => 'given up');
      element.remove();
      return Promise.race([taken, new Promise((resolve) => setTimeout(() => resolve('neither'), 10_000))]);
    });
    assert.notEqual(settled, 'neither');
  }),

  'a key that is let go elsewhere moves nothing any more': on('/page.html', {}, async (page) => {
    await set(page, { src: 'take.mcap' });
    await when(page, (p) => p.state === 'file' && p.paused && p.duration > 1);
    await page.evaluate(() => {
      const other = document.body.appendChild(document.createElement('button'));
      other.id = 'other';
    });
    await page.focus('relievo-player .view');
    await page.keyboard.down('w');
    await page.focus('#other');
    await page.keyboard.up('w');
    const pixels = () => page.evaluate(async () => {
      const bytes = new Uint8Array(await (await document.querySelector('relievo-player').screenshot()).arrayBuffer());
      return bytes.reduce((a, b) => (a * 31 + b) >>> 0, 7);
    });
    // It comes to rest before the surface is behind it.
    await eventually('it flies on', async () => (await pixels()) === (await pixels()));
    assert.ok((await opaque(page)) > 0.1);
  }),

  'out of sight, however that comes about, it receives and draws next to nothing, and then goes on at once': on('/page.html', { before: countFrames }, async (page) => {
    await set(page, { src: `${rig.address}/?stream=object` });
    await when(page, (p) => p.state === 'live' && p.duration > 1);
    const count = () => page.evaluate(() => ({ received: window.received_, drawn: window.drawn_ }));
    await page.evaluate(() => {
      window.states_ = [];
      window.drawn_ = window.number_ = 0;
      const element = document.querySelector('relievo-player');
      element.addEventListener('statechange', ({ detail }) => window.states_.push(detail.state));
      element.addEventListener('frame', ({ detail }) => {
        ++window.drawn_;
        window.number_ = detail.number;
      });
      document.body.style.height = '5000px';
    });
    for (const [away, back] of [
      [(p) => (p.style.display = 'none'), (p) => (p.style.display = '')],
      [(p) => (p.style.marginTop = '3000px'), (p) => (p.style.marginTop = '')],
      [kHide, kShow],
    ]) {
      await page.waitForFunction((before) => window.number_ > before, await page.evaluate(() => window.number_));
      await page.evaluate(() => void (window.states_.length = 0)); // a busy machine's stream may have stalled before
      await player(page, away);
      await turned(page);
      const before = await count();
      const published = await publishedOf(rig);
      await eventually('the stream stands still', async () => (await publishedOf(rig)) > published + 20); // well above any patience of the page
      const after = await count();
      const least = await page.evaluate(() => window.number_ + 12);
      assert.ok(after.received - before.received <= 2, `${away}: received ${after.received - before.received}`); // its credit
      assert.ok(after.drawn - before.drawn <= 1, `${away}: drew ${after.drawn - before.drawn}`);
      await player(page, back);
      await page.waitForFunction((number) => window.number_ > number, least);
      assert.deepEqual(await page.evaluate(() => window.states_), [], `${away}`);
    }
  }),

  'out of sight from the start, it has a picture and says so': on('/page.html', { before: countFrames }, async (page) => {
    await player(page, (p) => (p.style.display = 'none'));
    for (const [src, state] of [[`${rig.address}/?stream=object`, 'live'], ['take.mcap', 'file']]) {
      await set(page, { src });
      await page.waitForFunction((wanted) => document.querySelector('relievo-player').state === wanted, state);
    }
    await player(page, (p) => (p.style.display = ''));
    await eventually('there is no picture', async () => (await opaque(page).catch(() => 0)) > 0.15);
  }),

  'a recording goes on out of sight without being drawn, as a <video> does, to its end; what is asked for then is done': on('/page.html', {}, async (page) => {
    await page.evaluate(() => {
      window.frames_ = [];
      document.querySelector('relievo-player').addEventListener('frame', ({ detail }) => window.frames_.push(detail.number));
    });
    const drawn = () => page.evaluate(() => window.frames_.length);
    await set(page, { src: 'take.mcap', loop: true });
    await when(page, (p) => p.state === 'file' && p.duration > 1);
    await eventually('nothing is drawn', async () => (await drawn()) > 1);
    await player(page, (p) => (p.style.display = 'none'));
    await turned(page);
    const before = await drawn();
    for (let round = 0; round < 2; ++round) {
      await when(page, (p) => p.currentTime > 1);
      await when(page, (p) => p.currentTime < 1);
    }
    assert.ok((await drawn()) - before <= 1, `drew ${(await drawn()) - before}`);
    await set(page, { loop: false });
    await when(page, (p) => p.paused && p.currentTime === p.duration);
    const last = await page.evaluate(() => window.frames_.at(-1));
    await set(page, { currentTime: 0.5 });
    await page.waitForFunction((number) => window.frames_.at(-1) < number, last);
    await player(page, (p) => p.play());
    await player(page, (p) => (p.style.display = ''));
    await eventually('it does not go on', async () => (await drawn()) > before + 4);
  }),

  'thirty that come and go leave no worker, socket or clock behind': on('/page.html', {}, async (page) => {
    const open = new Set();
    page.on('websocket', (socket) => {
      open.add(socket);
      socket.on('close', () => open.delete(socket));
    });
    await page.evaluate(() => {
      document.querySelector('relievo-player').remove();
      const [start, end] = [window.setInterval, window.clearInterval];
      window.clocks_ = new Set();
      window.setInterval = (...rest) => {
        const id = start(...rest);
        window.clocks_.add(id);
        return id;
      };
      window.clearInterval = (id) => {
        window.clocks_.delete(id);
        end(id);
      };
    });
    await eventually('a worker is left of the first', () => page.workers().length === 0);
    for (let i = 0; i < 30; ++i) {
      await page.evaluate((src) => {
        const element = document.body.appendChild(document.createElement('relievo-player'));
        Object.assign(element, { controls: true, src });
      }, i % 2 === 0 ? `${rig.address}/?stream=object` : 'take.mcap');
      await when(page, (p) => p.state === 'live' || p.state === 'file');
      if (i % 10 === 0) await page.hover('relievo-player .track'); // reads pictures
      await page.evaluate(() => document.querySelector('relievo-player').remove());
    }
    await eventually('workers are left', () => page.workers().length === 0);
    await eventually('sockets are left', () => open.size === 0);
    assert.equal(await page.evaluate(() => window.clocks_.size), 0);
  }),

  'none of this was an error of the page'() {
    const expected = /WebSocket connection|Failed to load resource|CORS policy|ERR_/;
    assert.deepEqual(complaints.filter((text) => !expected.test(text)), []);
  },
};

let failed = 0;
try {
  for (const [name, check] of Object.entries(checks)) {
    try {
      await check();
      console.log(`ok    ${name}`);
    } catch (error) {
      ++failed;
      console.log(`FAIL  ${name}: ${error.stack}`);
    }
  }
} finally {
  await browser.close();
  await Server.killAll();
  web.close();
  lax.close();
  rmSync(scratch, { recursive: true, force: true });
}
console.log(failed === 0 ? 'all checks passed' : `${failed} checks failed`);
process.exit(failed === 0 ? 0 : 1);
