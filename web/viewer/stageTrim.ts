// SPDX-License-Identifier: Apache-2.0
// Leaves out of three.js what the stage never uses, which no minifier can know: shaders are text, and the renderer reaches
// environment maps and shadows whether there are any or not.
import { readFileSync } from 'node:fs';

/** Of three's switches USE_... and numbers NUM_..., those that the stage's materials and lights set. */
const kSet = new Set(['USE_MAP', 'USE_UV', 'USE_COLOR', 'USE_POINTS_UV', 'NUM_DIR_LIGHTS', 'NUM_HEMI_LIGHTS']);
/** Shaders of the materials in src/materials.ts and src/groundLines.ts. */
const kShaders = ['meshbasic', 'meshphysical', 'points'];
const kShaderFolder = 'renderers/shaders/';

/** By file of three's `renderers/webgl`: what stands there where there is no such thing. */
const kAbsent: Record<string, string> = {
  WebGLCubeMaps: 'export function WebGLCubeMaps() { return { get: (texture) => texture, dispose() {} }; }',
  WebGLCubeUVMaps: 'export function WebGLCubeUVMaps() { return { get: (texture) => texture, dispose() {} }; }',
  WebGLShadowMap: 'export function WebGLShadowMap() { this.enabled = false; this.render = () => {}; }',
};

const isNeverSet = (name: string): boolean => /^(USE|NUM)_/.test(name) && !kSet.has(name);

/** 0: false whatever else is set, 2: true, 1: it depends. */
type Truth = 0 | 1 | 2;

/** Of a condition of the preprocessor. */
export function truth(condition: string): Truth {
  let rest = condition
    .replace(/\/\/.*/, '')
    .replace(/defined\s*\(\s*(\w+)\s*\)/g, (_, name: string) => (isNeverSet(name) ? '0' : '1'))
    .replace(/(\w+)\s*>\s*0/g, (_, name: string) => (isNeverSet(name) ? '0' : '1'))
    .replace(/\w+\s*<\s*(\w+)/g, (_, name: string) => (isNeverSet(name) ? '0' : '1'))
    .replace(/\s+/g, '');
  const flat = (terms: string): number =>
    Math.max(...terms.split('||').map((factors) => Math.min(...factors.split('&&').map(single))));
  const single = (term: string): number => (term.startsWith('!') ? 2 - single(term.slice(1)) : /^[012]$/.test(term) ? Number(term) : 1);
  for (let before = ''; before !== rest; ) {
    before = rest;
    rest = rest.replace(/\(([^()]*)\)/, (_, inner: string) => String(flat(inner)));
  }
  return flat(rest) as Truth;
}

/** A shader's text without comments, indentation, and the branches that are never taken. */
export function liveText(text: string): string {
  interface Branches {
    outer: boolean; // what is around them is kept
    kept: boolean; // this branch is
    opened: boolean; // there is an #if in what is kept
    ended: boolean; // one was always taken: those after it never are
  }
  const lines: string[] = [];
  const open: Branches[] = [];
  for (const line of text.replace(/\/\/.*$/gm, '').split(/\n\s*/)) {
    const [, word, condition = ''] = /^#(ifdef|ifndef|if|elif|else|endif)\b\s*(.*)$/.exec(line.trim()) ?? [];
    const top = open.at(-1);
    if (word === undefined) {
      if (top?.kept !== false && line.trim() !== '') lines.push(line.trimEnd());
    } else if (word === 'endif') {
      open.pop();
      if (top!.opened) lines.push('#endif');
    } else {
      const begins = word.startsWith('if');
      const of: Branches = begins ? { outer: top?.kept !== false, kept: false, opened: false, ended: false } : top!;
      if (begins) open.push(of);
      const asked = word === 'ifdef' ? `defined(${condition})` : word === 'ifndef' ? `!defined(${condition})` : condition;
      const value = word === 'else' ? 2 : truth(asked);
      of.kept = of.outer && !of.ended && value > 0;
      if (!of.kept) continue;
      of.ended = value === 2;
      if (of.opened) lines.push(word === 'else' ? '#else' : `#elif ${condition}`);
      else if (value === 1) lines.push(word === 'elif' ? `#if ${condition}` : line.trim());
      of.opened ||= value === 1;
    }
  }
  let live = `${lines.join('\n')}\n`;
  for (let before = ''; before !== live; ) {
    before = live;
    live = live.replace(/^#if.*\n#endif\n/gm, '');
  }
  return live === '\n' ? '' : live;
}

const literals = /`([^`]*)`/g;

/** Names of the chunks that the shaders of kShaders include, through others too, and of those that any may get. `source`: three's folder. */
function reachable(source: string): Set<string> {
  const found = new Set<string>();
  const add = (name: string): void => {
    if (found.has(name)) return;
    found.add(name);
    follow(`ShaderChunk/${name}`);
  };
  const follow = (file: string): void => {
    for (const [, text] of readFileSync(`${source}${kShaderFolder}${file}.glsl.js`, 'utf8').matchAll(literals)) {
      for (const [, name] of liveText(text!).matchAll(/#include <(\w+)>/g)) add(name!);
    }
  };
  for (const name of kShaders) follow(`ShaderLib/${name}`);
  const program = readFileSync(`${source}renderers/webgl/WebGLProgram.js`, 'utf8');
  for (const [, name] of program.matchAll(/ShaderChunk\[ '(\w+)' \]/g)) add(name!);
  return found;
}

/** Of one of three's files, `id`; null: as it is. `source`: three's folder, with its / at the end. */
export function trimmer(source: string): (code: string, id: string) => string | null {
  let chunks: Set<string> | null = null;
  return (code, id) => {
    if (!id.startsWith(source)) return null;
    const [, folder, name] = /(\w+)\/(\w+)(?:\.glsl)?\.js$/.exec(id) ?? [];
    if (folder === 'webgl' && name! in kAbsent) return kAbsent[name!]!;
    if (!id.endsWith('.glsl.js')) return null;
    chunks ??= reachable(source);
    const isUsed = folder === 'ShaderLib' ? kShaders.includes(name!) : chunks.has(name!);
    return code.replace(literals, (_, text: string) => (isUsed ? `\`${liveText(text)}\`` : '``'));
  };
}
