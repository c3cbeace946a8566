// SPDX-License-Identifier: Apache-2.0
declare module 'draco3d/draco_decoder_nodejs.js' {
  import type { DecoderModule } from 'draco3d';
  export default function createDecoder(options: { wasmBinary: ArrayBuffer }): Promise<DecoderModule>;
}
