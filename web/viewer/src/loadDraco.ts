// SPDX-License-Identifier: Apache-2.0
// Draco's decoder with its WebAssembly, fetched by who needs it: the first load of a page does without.
import wasmUrl from 'draco3d/draco_decoder.wasm?url';
import type { DracoDecoder } from './draco';

/** Throws where either does not come. */
export async function loadDraco(): Promise<DracoDecoder> {
  const [{ DracoDecoder }, response] = await Promise.all([import('./draco'), fetch(wasmUrl)]);
  if (!response.ok) throw new Error(`HTTP ${response.status}`);
  return DracoDecoder.create(await response.arrayBuffer());
}
