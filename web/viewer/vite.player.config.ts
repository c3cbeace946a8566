// SPDX-License-Identifier: Apache-2.0
// The npm package of web/player, from the viewer's own modules.
import { defineConfig } from 'vitest/config';

export default defineConfig({
  root: '../player',
  base: './',
  publicDir: false,
  build: {
    target: 'es2022',
    assetsInlineLimit: 0, // as for the viewer: pages may forbid data: URLs
    chunkSizeWarningLimit: 1024,
    reportCompressedSize: false,
    modulePreload: false,
    rollupOptions: {
      input: '../player/src/index.ts',
      preserveEntrySignatures: 'strict',
      output: { entryFileNames: 'relievo-player.js' },
    },
  },
  worker: { format: 'es' },
});
