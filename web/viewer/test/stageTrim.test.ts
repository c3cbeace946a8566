// SPDX-License-Identifier: Apache-2.0
import { readdirSync, readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { describe, expect, it } from 'vitest';
import { liveText, trimmer, truth } from '../stageTrim';

const kThree = createRequire(import.meta.url).resolve('three').replace(/build\/three\.\w+$/, 'src/');
const kShaders = `${kThree}renderers/shaders/`;

/** What the graphics card compiles of `text` where `set` are defined, with these values: a preprocessor the plain way. */
function preprocessed(text: string, set: Map<string, number>): string {
  const number = (word: string): number => set.get(word) ?? (/^\d+$/.test(word) ? Number(word) : 0);
  const holds = (condition: string): boolean => {
    const js = condition
      .replace(/defined\s*\(\s*(\w+)\s*\)/g, (_, name: string) => String(set.has(name)))
      .replace(/[A-Za-z]\w*/g, (word) => (word === 'true' || word === 'false' ? word : String(number(word))));
    return Boolean(new Function(`return ${js};`)());
  };
  const out: string[] = [];
  const open: { outer: boolean; now: boolean; taken: boolean }[] = [];
  for (const raw of text.replace(/\/\/.*$/gm, '').split('\n')) {
    const line = raw.trim();
    const [, word, condition = ''] = /^#(ifdef|ifndef|if|elif|else|endif)\b\s*(.*)$/.exec(line) ?? [];
    const top = open.at(-1);
    if (word === undefined) {
      if (top?.now !== false && line !== '') out.push(line);
    } else if (word === 'endif') {
      open.pop();
    } else {
      const yes = word === 'else' || (word === 'ifdef' ? set.has(condition) : word === 'ifndef' ? !set.has(condition) : holds(condition));
      if (word.startsWith('if')) open.push({ outer: top?.now !== false, now: (top?.now !== false) && yes, taken: yes });
      else Object.assign(top!, { now: top!.outer && !top!.taken && yes, taken: top!.taken || yes });
    }
  }
  return out.join('\n');
}

describe('what is left out of the shaders', () => {
  it('a condition is decided where what it asks for is never set, and else left', () => {
    expect(truth('defined( USE_SHADOWMAP ) && NUM_DIR_LIGHT_SHADOWS > 0')).toBe(0);
    expect(truth('! defined( USE_SHADOWMAP )')).toBe(2);
    expect(truth('defined( USE_MAP ) || defined( USE_ALPHAMAP )')).toBe(1);
    expect(truth('( NUM_SPOT_LIGHTS > 0 ) && defined( RE_Direct )')).toBe(0);
    expect(truth('( NUM_DIR_LIGHTS > 0 ) && defined( RE_Direct )')).toBe(1);
    expect(truth('DEPTH_PACKING == 3200')).toBe(1);
  });

  it('branches go, what is around them stays', () => {
    expect(liveText('a;\n#ifdef USE_FOG\n\tb;\n#else\n\tc; // why\n#endif\n')).toBe('a;\nc;\n');
    expect(liveText('#if defined( USE_FOG )\na;\n#elif defined( USE_MAP )\nb;\n#else\nc;\n#endif')).toBe('#if defined( USE_MAP )\nb;\n#else\nc;\n#endif\n');
    expect(liveText('#ifdef USE_MAP\n#ifdef USE_FOG\na;\n#endif\n#endif')).toBe('');
  });

  it('each of three.js is compiled to the same, whatever the stage sets', () => {
    const sets = [
      ['OPAQUE', 'USE_MAP', 'USE_UV', 'DOUBLE_SIDED'],
      ['STANDARD', 'PHYSICAL', 'OPAQUE', 'ALPHA_TO_COVERAGE', 'RE_Direct', 'RE_IndirectDiffuse', 'RE_IndirectSpecular'],
      ['USE_COLOR', 'USE_POINTS_UV', 'USE_MAP', 'FLIP_SIDED', 'HIGH_PRECISION'],
      [],
    ].map((names) => new Map([...names.map((n) => [n, 1] as const), ['NUM_DIR_LIGHTS', 1], ['NUM_HEMI_LIGHTS', 1]]));
    let [shaders, shorter] = [0, 0];
    for (const file of readdirSync(kShaders, { recursive: true, encoding: 'utf8' })) {
      if (!file.endsWith('.glsl.js')) continue;
      for (const [, text] of readFileSync(kShaders + file, 'utf8').matchAll(/`([^`]*)`/g)) {
        const live = liveText(text!);
        ++shaders;
        shorter += Number(live.length < 0.5 * text!.length);
        for (const set of sets) expect(preprocessed(live, set), file).toBe(preprocessed(text!, set));
      }
    }
    expect(shaders).toBeGreaterThan(100);
    expect(shorter).toBeGreaterThan(50);
  });

  it('shaders that no material has are empty, those of the surface are not', () => {
    const trim = trimmer(kThree);
    const trimmed = (file: string): string => trim(readFileSync(kThree + file, 'utf8'), kThree + file)!;
    expect(trimmed('renderers/shaders/ShaderLib/meshtoon.glsl.js')).toMatch(/vertex = (\/\* glsl \*\/)?``/);
    expect(trimmed('renderers/shaders/ShaderLib/meshbasic.glsl.js')).toContain('#include <alphatest_fragment>');
    expect(trimmed('renderers/shaders/ShaderChunk/project_vertex.glsl.js')).toContain('gl_Position = projectionMatrix * mvPosition;');
    expect(trimmed('renderers/shaders/ShaderChunk/colorspace_pars_fragment.glsl.js'), 'the renderer puts it before others').toContain('vec4 sRGBTransferOETF');
    expect(trimmed('renderers/shaders/ShaderChunk/lights_toon_pars_fragment.glsl.js')).toContain('``');
    expect(trimmed('renderers/webgl/WebGLShadowMap.js')).not.toContain('import');
    expect(trim('', `${kThree}renderers/WebGLRenderer.js`)).toBe(null);
  });
});
