// SPDX-License-Identifier: Apache-2.0
// The npm package of web/player, from the viewer's own modules.
import { fileURLToPath } from 'node:url';
import { defineConfig } from 'vitest/config';
import { stageUrl } from './stagePlugin';

export default defineConfig({
  root: '../player',
  base: './',
  publicDir: false,
  plugins: [stageUrl(fileURLToPath(new URL('.', import.meta.url)))],
  build: {
    target: 'es2022',
    assetsInlineLimit: 0, // as for the viewer: pages may forbid data: URLs
    chunkSizeWarningLimit: 1024,
    reportCompressedSize: false,
    modulePreload: false,
    rollupOptions: {
      input: '../player/src/index.ts',
      preserveEntrySignatures: 'strict',
      output: { entryFileNames: ({ name }) => (name === 'index' ? 'relievo-player.js' : 'assets/[name]-[hash].js') },
    },
  },
  worker: { format: 'es' },
});
