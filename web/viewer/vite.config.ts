// SPDX-License-Identifier: Apache-2.0
import { defineConfig } from 'vitest/config';

// The gateway a developer's `npm run dev` page talks to.
const gateway = process.env['RELIEVO_GATEWAY'] ?? 'http://127.0.0.1:8080';

export default defineConfig({
  base: './',
  build: {
    target: 'es2022',
    // Inlined assets would be data: URLs, which the gateway's content policy forbids for scripts and wasm.
    assetsInlineLimit: 0,
    chunkSizeWarningLimit: 1024,
    reportCompressedSize: false,
  },
  worker: { format: 'es' },
  server: {
    proxy: {
      '/api': gateway,
      '/ws': { target: gateway, ws: true, changeOrigin: true, rewriteWsOrigin: true },
    },
  },
  // Far more than a test needs: a loaded machine may take its time.
  test: { include: ['test/**/*.test.ts'], testTimeout: 60_000, hookTimeout: 60_000, teardownTimeout: 60_000 },
});
