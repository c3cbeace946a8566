// SPDX-License-Identifier: Apache-2.0
// The page's workers, as they are started by it and, before its code is there, some of them by boot.ts.
import stageUrl from 'virtual:stage-url';

export const startDecoder = (): Worker => new Worker(new URL('./decoder.worker.ts', import.meta.url), { type: 'module' });
export const startStage = (): Worker => new Worker(stageUrl, { type: 'module' });

export const startMeasurer = (): Worker => new Worker(new URL('./shape.worker.ts', import.meta.url), { type: 'module' });

/** Whether the browser may let workers draw; whether they have WebGL 2 is not asked. */
export const hasOffscreen = (): boolean =>
  typeof OffscreenCanvas !== 'undefined' && 'transferControlToOffscreen' in HTMLCanvasElement.prototype;
