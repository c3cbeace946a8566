// SPDX-License-Identifier: Apache-2.0
// Measures shapes off the main thread: of a region of a large picture a frame takes a second.
import type { ShapeReply, ShapeRequest } from './shapeMessages';
import { fullOf, ShapeMeter } from './shapeMeter';

const kWidth = 640; // of the picture, at most: it is shown far smaller

let meter: ShapeMeter | null = null;
let queue: Promise<void> = Promise.resolve();

self.onmessage = ({ data }: MessageEvent<ShapeRequest>) => {
  queue = queue.then(async () => {
    const reply = await measure(data).catch((error: unknown): ShapeReply => ({ type: 'failed', message: error instanceof Error ? error.message : String(error) }));
    const transfer = reply.type === 'measured' && reply.picture !== null ? [reply.picture] : [];
    self.postMessage(reply, { transfer });
  });
};

async function measure({ meter: wanted, joins, surface }: ShapeRequest): Promise<ShapeReply> {
  const start = performance.now();
  if (wanted !== null) meter = new ShapeMeter(wanted.lens, wanted.region, wanted.kind);
  if (meter === null) throw new Error('nothing says what is to be measured');
  if (joins === 'none') meter.clear();
  meter.add(surface, joins === 'butTheLast');
  const report = meter.report();
  const full_m = report === null ? 0 : fullOf(report);
  const picture = report === null ? null : await pictureOf(meter, full_m);
  return { type: 'measured', report, shape: meter.shape, picture, full_m, took_ms: performance.now() - start };
}

function pictureOf(of: ShapeMeter, full_m: number): Promise<ImageBitmap> {
  const { width, height } = of.region;
  const rgba = new ImageData(of.picture(full_m), width, height);
  if (width <= kWidth) return createImageBitmap(rgba);
  return createImageBitmap(rgba, { resizeWidth: kWidth, resizeHeight: Math.max(1, Math.round((height * kWidth) / width)) });
}
