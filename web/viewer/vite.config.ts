// SPDX-License-Identifier: Apache-2.0
import { createHash } from 'node:crypto';
import { readdirSync, readFileSync, statSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import type { Plugin } from 'vite';
import { defineConfig } from 'vitest/config';
import { stageUrl } from './stagePlugin';

const kServiceWorker = 'sw.js';

/** Tells the service worker what the page is made of. */
const listFiles: Plugin = {
  name: 'relievo-list-files',
  apply: 'build',
  writeBundle({ dir }) {
    const all = readdirSync(dir!, { recursive: true, encoding: 'utf8' }).sort();
    const files = all.filter((file) => file !== kServiceWorker && statSync(join(dir!, file)).isFile());
    const hash = createHash('sha256');
    for (const file of files) hash.update(file).update(readFileSync(join(dir!, file)));
    const worker = join(dir!, kServiceWorker);
    const names = files.map((file) => (file === 'index.html' ? './' : file));
    const code = readFileSync(worker, 'utf8')
      .replaceAll('RELIEVO_FILES', JSON.stringify(names))
      .replaceAll('RELIEVO_VERSION', JSON.stringify(hash.digest('hex').slice(0, 16)));
    writeFileSync(worker, code);
  },
};

/** What boot.ts asks for is there sooner: the page's code, and what the drawing worker imports. */
const preload: Plugin = {
  name: 'relievo-preload',
  apply: 'build',
  transformIndexHtml: {
    order: 'post',
    handler(html, { bundle, path }) {
      if (path !== '/index.html') return [];
      const chunks = Object.values(bundle ?? {}).filter((file) => file.type === 'chunk');
      const started = chunks.filter(({ name }) => name === 'main' || name === 'stage');
      const files = new Set(started.flatMap(({ fileName, name, imports }) => (name === 'main' ? [fileName, ...imports] : imports)));
      const more = [...files].filter((file) => !html.includes(file));
      return more.map((file) => ({ tag: 'link', attrs: { rel: 'modulepreload', crossorigin: true, href: `./${file}` }, injectTo: 'head' }));
    },
  },
};

// The gateway a developer's `npm run dev` page talks to.
const gateway = process.env['RELIEVO_GATEWAY'] ?? 'http://127.0.0.1:8080';

export default defineConfig({
  base: './',
  plugins: [listFiles, preload, stageUrl(fileURLToPath(new URL('.', import.meta.url)))],
  build: {
    target: 'es2022',
    // Inlined assets would be data: URLs, which the gateway's content policy forbids for scripts and wasm.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false }, // who lacks it loads the same a little later
    chunkSizeWarningLimit: 1024,
    reportCompressedSize: false,
    rollupOptions: {
      input: { index: 'index.html', rig: 'rig.html', sw: 'src/serviceWorker.ts' },
      // A service worker is told to be new by its content, at an address that stays.
      output: { entryFileNames: ({ name }) => (name === 'sw' ? kServiceWorker : 'assets/[name]-[hash].js') },
    },
  },
  worker: { format: 'es' },
  server: {
    fs: { allow: ['.', '../../idl'] },
    proxy: {
      '/api': gateway,
      '/ws': { target: gateway, ws: true, changeOrigin: true, rewriteWsOrigin: true },
    },
  },
  // Far more than a test needs: a loaded machine may take its time.
  test: {
    include: ['test/**/*.test.ts'],
    setupFiles: ['test/breathe.ts'],
    testTimeout: 300_000,
    hookTimeout: 300_000,
    teardownTimeout: 300_000,
  },
});
