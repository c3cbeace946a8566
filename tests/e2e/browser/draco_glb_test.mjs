// SPDX-License-Identifier: Apache-2.0
// Proves, in headless Chromium: three.js's GLTFLoader, with nothing but its own DRACOLoader, opens what
// `relievo export --draco` writes, stills and animations, and finds the surface of the same export without.
// Run as: in_own_domain node draco_glb_test.mjs RELIEVO_SERVER RELIEVO, in web/viewer. Exit 77: no Chromium.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, readdirSync, rmSync, statSync } from 'node:fs';
import { createServer } from 'node:http';
import { tmpdir } from 'node:os';
import { extname, join } from 'node:path';
import { kPatienceMs, launchChromium } from './chromium.mjs';

const [serverPath, relievoPath] = process.argv.slice(2);
const kFrames = 3;
const kThree = join(process.cwd(), 'node_modules/three');
const kTypes = { '.js': 'text/javascript', '.wasm': 'application/wasm' };
const kPage = `<!doctype html><script type="importmap">{"imports": {
  "three": "/three/build/three.module.js", "three/addons/": "/three/examples/jsm/"}}</script>`;

/** In the page: what the loader makes of a file. Loose points of the plain file are of no triangle, and do not count. */
async function describe(path) {
  const THREE = await import('three');
  const { GLTFLoader } = await import('three/addons/loaders/GLTFLoader.js');
  const { DRACOLoader } = await import('three/addons/loaders/DRACOLoader.js');
  const draco = new DRACOLoader().setDecoderPath('/three/examples/jsm/libs/draco/');
  const { scene, animations } = await new GLTFLoader().setDRACOLoader(draco).loadAsync(path);
  draco.dispose();
  const meshes = [];
  scene.traverse((node) => node.isMesh && meshes.push(node));
  return {
    channels: animations.map(({ tracks }) => tracks.length),
    meshes: meshes.map(({ geometry, material }) => {
      const { position, normal, uv } = geometry.attributes;
      const used = [...new Set(geometry.index.array)];
      const box = new THREE.Box3();
      const length = new THREE.Vector3();
      const lengths = used.map((v) => length.fromBufferAttribute(normal, v).length());
      for (const v of used) box.expandByPoint(new THREE.Vector3().fromBufferAttribute(position, v));
      return {
        vertices: used.length,
        counts: [position.count, normal.count, uv.count],
        triangles: geometry.index.count / 3,
        bounds: [...box.min.toArray(), ...box.max.toArray()],
        declared: geometry.boundingBox && [...geometry.boundingBox.min.toArray(), ...geometry.boundingBox.max.toArray()],
        normals: [Math.min(...lengths), Math.max(...lengths)],
        picture: [material.map.image.width, material.map.image.height],
        unlit: material.isMeshBasicMaterial,
      };
    }),
  };
}

const scratch = mkdtempSync(join(tmpdir(), 'relievo-draco-'));
const server = createServer((request, response) => {
  if (request.url === '/') return response.writeHead(200, { 'content-type': 'text/html' }).end(kPage);
  const [root, path] = request.url.startsWith('/three/') ? [kThree, request.url.slice(7)] : [scratch, request.url];
  try {
    const body = readFileSync(join(root, path));
    response.writeHead(200, { 'content-type': kTypes[extname(path)] ?? 'application/octet-stream' }).end(body);
  } catch {
    response.writeHead(404).end();
  }
});

let browser;
try {
  const recorded = join(scratch, 'object.mcap');
  execFileSync(
    serverPath,
    ['serve', '--source', 'sim:object,width=320,height=240,stripes=60', '--fast', '--frames', `${kFrames}`, '--web', 'none', '--record',
      recorded, '--domain', process.env.RELIEVO_TEST_DOMAIN, '--interface', 'lo'],
    { stdio: 'ignore' },
  );
  const run = (...more) => execFileSync(relievoPath, ['export', recorded, ...more], { stdio: ['ignore', 'ignore', 'pipe'] });
  for (const draco of [[], ['--draco']]) {
    run('--format', 'glb', ...draco, '--out', join(scratch, `glb${draco}`));
    run('--format', 'animation', ...draco, '--out', join(scratch, `animation${draco}.glb`));
  }
  for (const format of ['ply', 'obj', 'png', 'depth', 'video']) {
    assert.throws(() => run('--format', format, '--draco', '--out', join(scratch, 'none.mp4')), /no Draco in/, format);
  }

  await new Promise((resolve, reject) => server.once('error', reject).listen(0, '127.0.0.1', resolve));
  browser = await launchChromium();
  const page = await browser.newPage();
  page.setDefaultTimeout(kPatienceMs);
  await page.goto(`http://127.0.0.1:${server.address().port}/`);

  const frame = readdirSync(join(scratch, 'glb')).sort().at(-1);
  for (const [plainPath, dracoPath] of [[`glb/${frame}`, `glb--draco/${frame}`], ['animation.glb', 'animation--draco.glb']]) {
    const plain = await page.evaluate(describe, `/${plainPath}`);
    const draco = await page.evaluate(describe, `/${dracoPath}`);
    const [dracoBytes, plainBytes] = [dracoPath, plainPath].map((path) => statSync(join(scratch, path)).size);
    console.log(`${dracoPath}: ${dracoBytes} bytes, without Draco ${plainBytes}`);
    assert.ok(dracoBytes < plainBytes / 4);
    assert.deepEqual(draco.channels, plain.channels);
    assert.equal(draco.meshes.length, plain.meshes.length);
    draco.meshes.forEach((mesh, i) => {
      const of = plain.meshes[i];
      assert.deepEqual(mesh.counts, Array(3).fill(mesh.vertices), 'nothing in it that is not shown');
      assert.equal(mesh.triangles, of.triangles);
      assert.ok(of.vertices > 1000);
      // Draco splits vertices where triangles meet in nothing else.
      assert.ok(mesh.vertices >= of.vertices && mesh.vertices < 1.01 * of.vertices, `${mesh.vertices} of ${of.vertices}`);
      assert.deepEqual([mesh.picture, mesh.unlit], [[320, 240], true]);
      assert.ok(mesh.normals[0] > 0.999 && mesh.normals[1] < 1.001, `${mesh.normals}`);
      const edge = Math.max(...[0, 1, 2].map((axis) => of.bounds[axis + 3] - of.bounds[axis]));
      mesh.bounds.forEach((x, k) => assert.ok(Math.abs(x - of.bounds[k]) <= edge / 16_000, `${mesh.bounds} ${of.bounds}`));
      assert.deepEqual(mesh.declared, mesh.bounds, 'the accessor tells the bounds of what is decoded');
    });
  }
} finally {
  await browser?.close();
  server.close();
  server.closeAllConnections();
  rmSync(scratch, { recursive: true, force: true });
}
