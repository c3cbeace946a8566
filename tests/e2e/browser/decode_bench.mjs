// SPDX-License-Identifier: Apache-2.0
// Measures, in headless Chromium: how long the page's worker takes to decode the frames of a recording, in milliseconds, with
// the pages given taking turns frame by frame. `decode` is the worker's own time, `round` from handing a frame over to having
// its arrays. Run as: node decode_bench.mjs [--rounds N] [--whole] FILE.mcap DIST..., in web/viewer; DIST is a built page
// (build/release/web/viewer/dist). Without --whole textures are left out.
import assert from 'node:assert/strict';
import { readdirSync, readFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { createRequire } from 'node:module';
import { extname, join } from 'node:path';
import { parseArgs } from 'node:util';
import { launchChromium } from './chromium.mjs';

const { McapStreamReader } = createRequire(join(process.cwd(), 'package.json'))('@mcap/core');

const { values, positionals } = parseArgs({
  options: { rounds: { type: 'string', default: '30' }, whole: { type: 'boolean', default: false } },
  allowPositionals: true,
});
const [file, ...dists] = positionals;
assert.ok(file && dists.length > 0, 'give a recording and the folders of built pages');

/** The frame's bytes in a message: those from its magic on. */
function frameOf(data) {
  const at = Buffer.from(data.buffer, data.byteOffset, data.byteLength).indexOf('RLVF');
  return at < 0 ? null : Buffer.from(data.subarray(at, at + new DataView(data.buffer, data.byteOffset).getUint32(at - 4, true)));
}

/** The same frame without its texture (codec/FORMAT.md, "Header"). */
function withoutTexture(frame) {
  const out = [];
  let at = frame.readUInt16LE(6);
  const table = frame.readUInt16LE(58);
  const sections = Array.from({ length: frame[56] }, (_, i) => {
    const entry = frame.subarray(table + i * frame[57], table + (i + 1) * frame[57]);
    const size = entry.readUInt32LE(4);
    at += size;
    return { entry, bytes: frame.subarray(at - size, at) };
  }).filter(({ entry }) => entry[0] !== 2);
  const head = Buffer.from(frame.subarray(0, table));
  head[56] = sections.length;
  head.writeUInt16LE(table + sections.length * frame[57], 6);
  head.writeUInt32LE(0, 48);
  head.writeUInt32LE(0, 52);
  out.push(head, ...sections.map((s) => s.entry), ...sections.map((s) => s.bytes));
  return Buffer.concat(out);
}

const reader = new McapStreamReader();
reader.append(readFileSync(file));
let frames = [];
for (let record = reader.nextRecord(); record !== undefined; record = reader.nextRecord()) {
  if (record.type === 'Message') frames.push(frameOf(record.data));
}
frames = frames.filter((frame) => frame !== null).map((frame) => (values.whole ? frame : withoutTexture(frame)));
assert.ok(frames.length > 0, `${file} has no frames`);

const kTypes = { '.js': 'text/javascript', '.wasm': 'application/wasm' };
const server = createServer((request, response) => {
  const [, which, ...path] = request.url.split('/');
  if (which === 'page') return response.setHeader('content-type', 'text/html').end('<!doctype html>');
  if (which === 'frame') return response.end(frames[Number(path[0])]);
  if (dists[which] === undefined) return response.writeHead(404).end();
  response.setHeader('content-type', kTypes[extname(request.url)] ?? 'application/octet-stream');
  response.end(readFileSync(join(dists[which], ...path)));
});
await new Promise((resolve) => server.listen(0, '127.0.0.1', resolve));
const origin = `http://127.0.0.1:${server.address().port}`;

const workers = dists.map((dist, i) => {
  const name = readdirSync(join(dist, 'assets')).find((f) => /^decoder\.worker.*\.js$/.test(f));
  assert.ok(name, `${dist} holds no built page`);
  return `${origin}/${i}/assets/${name}`;
});

const browser = await launchChromium();
try {
  const page = await browser.newPage();
  await page.goto(`${origin}/page`);
  const measured = await page.evaluate(
    async ({ workers, count, rounds }) => {
      const next = (worker) =>
        new Promise((resolve, reject) => {
          worker.onmessage = ({ data }) => (data.type === 'failed' || data.type === 'unusable' ? reject(new Error(data.message)) : resolve(data));
          worker.onerror = (event) => reject(new Error(event.message));
        });
      const all = await Promise.all(
        workers.map(async (url) => {
          const worker = new Worker(url, { type: 'module' });
          await next(worker); // ready
          return { worker, decode: [], round: [], vertices: 0, spares: [] };
        }),
      );
      const frames = await Promise.all(Array.from({ length: count }, async (_, i) => (await fetch(`/frame/${i}`)).arrayBuffer()));
      for (let round = 0; round < rounds; ++round) {
        for (const [id, frame] of frames.entries()) {
          for (const one of all) {
            const bytes = frame.slice(0);
            const start = performance.now();
            const spares = one.spares; // of the frame before, as the page gives it back
            const want = { normals: false, edges: false, quality: false };
            one.worker.postMessage({ type: 'decode', id, bytes, offset: 0, want, spares }, [bytes, ...spares]);
            const answer = await next(one.worker);
            const arrays = [answer.positions, answer.coordinates, answer.triangles, answer.quality?.sigmas, answer.quality?.interpolated];
            one.spares = arrays.flatMap((array) => (array ? [array.buffer] : []));
            answer.texture?.close();
            if (round < 3) continue; // until the compiler knows the code
            one.round.push(performance.now() - start);
            one.decode.push(answer.decodeMs);
            one.vertices = Math.max(one.vertices, answer.positions.length / 3);
          }
        }
      }
      return all.map(({ decode, round, vertices }) => ({ decode, round, vertices }));
    },
    { workers, count: frames.length, rounds: Number(values.rounds) + 3 },
  );
  for (const [i, { decode, round, vertices }] of measured.entries()) {
    const told = (samples) => {
      samples.sort((a, b) => a - b);
      const at = (share) => samples[Math.floor(share * (samples.length - 1))].toFixed(1);
      return `${at(0.5)} (${at(0.1)}..${at(0.9)})`;
    };
    console.log(`${dists[i]}: ${vertices} vertices, decode ${told(decode)} ms, round ${told(round)} ms, n ${decode.length}`);
  }
} finally {
  await browser.close();
  server.close();
}
