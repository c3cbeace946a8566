// SPDX-License-Identifier: Apache-2.0
// The drawing worker as a part of the page's own build, where it shares three.js with the page: bundled by itself, as workers
// are, it would bring all of that along once more. Of three.js the worker alone has the renderer.
import { createRequire } from 'node:module';
import type { Plugin } from 'vite';
import { trimmer } from './stageTrim';

const kName = 'virtual:stage-url';
const kThree = createRequire(import.meta.url).resolve('three').replace(/build\/three\.\w+$/, 'src/');
const trim = trimmer(kThree);
const kWorker = '/src/stage.worker.ts'; // in the viewer's folder

/** `root`: the viewer's folder. Gives `virtual:stage-url`, the address of the worker's module. */
export function stageUrl(root: string): Plugin {
  let isBuild = true;
  return {
    name: 'relievo-stage-url',
    enforce: 'pre',
    configResolved: ({ command }) => void (isBuild = command === 'build'),
    resolveId(id, importer = '') {
      if (id === kName) return `\0${kName}`;
      // By its own modules, so that each part of the page has what it uses.
      if (!isBuild || id !== 'three') return null;
      return kThree + (importer.endsWith('/stage.ts') ? 'Three.js' : 'Three.Core.js');
    },
    transform(code, id) {
      const trimmed = isBuild ? trim(code, id) : null;
      return trimmed === null ? null : { code: trimmed, map: null };
    },
    load(id) {
      if (id !== `\0${kName}`) return null;
      if (!isBuild) return `export default ${JSON.stringify(kWorker)};`;
      const chunk = this.emitFile({ type: 'chunk', id: root.replace(/\/$/, '') + kWorker, name: 'stage', preserveSignature: 'strict' });
      return `export default import.meta.ROLLUP_FILE_URL_${chunk};`;
    },
  };
}
