// SPDX-License-Identifier: Apache-2.0
// What the surface is drawn with. All know the lens of the rig's camera, so that its own view is exact.
import * as THREE from 'three';
import { kRimCut } from './rims';
import { lensOf } from './rigCamera';
import { depthColour, type Range } from './palette';
import type { Mode } from './display';
import type { Pinhole } from './protocol';

/** Colours of the surface where the texture is not shown; see style.css for the page's. */
const kClay = 0xd2ccc2;
const kWire = 0x86b7ff;
const kFill = 0x11151b;
const kColours = 256;
const kDimmed = 0.34; // as body.dim of style.css

const kLensHead = `
uniform vec4 lens; // k1 k2 p1 p2
uniform vec2 lensRest; // k3, 1 where it is on
vec4 throughLens(vec4 view) {
  if (lensRest.y == 0.0) return view;
  vec2 p = vec2(view.x, -view.y) / -view.z;
  float r2 = dot(p, p);
  float radial = 1.0 + r2 * (lens.x + r2 * (lens.y + r2 * lensRest.x));
  vec2 d = p * radial + vec2(2.0 * lens.z * p.x * p.y + lens.w * (r2 + 2.0 * p.x * p.x),
                             lens.z * (r2 + 2.0 * p.y * p.y) + 2.0 * lens.w * p.x * p.y);
  return vec4(d.x * -view.z, d.y * view.z, view.zw);
}
`;

const kRimVertexHead = `
#ifdef SMOOTH_RIMS
attribute float rim;
varying float rimOf;
#endif
`;
const kRimVertex = `
#ifdef SMOOTH_RIMS
rimOf = rim;
#endif
`;
// Alpha is which of the card's samples are covered, where it takes several.
const kRimFragment = `
#ifdef SMOOTH_RIMS
float share = clamp((rimOf - ${kRimCut.toFixed(3)}) / max(fwidth(rimOf), 1e-5) + 0.5, 0.0, 1.0);
#ifdef ALPHA_TO_COVERAGE
if (share == 0.0) discard;
diffuseColor.a = share;
#else
if (share < 0.5) discard;
#endif
#endif
`;

export class Materials {
  private readonly lens = { lens: { value: new THREE.Vector4() }, lensRest: { value: new THREE.Vector2() } };
  private smooth_ = false;
  private dimmed_ = false;
  private readonly depthRange = { value: new THREE.Vector2(0, 1) };

  readonly textured: THREE.MeshBasicMaterial;
  readonly shaded = new THREE.MeshStandardMaterial({ color: kClay, roughness: 0.7, side: THREE.DoubleSide });
  /** Hides the lines behind the surface without covering those on it. */
  readonly fill = new THREE.MeshBasicMaterial({
    color: kFill,
    side: THREE.DoubleSide,
    polygonOffset: true,
    polygonOffsetFactor: 1,
    polygonOffsetUnits: 1,
  });
  readonly coloured = new THREE.MeshBasicMaterial({ vertexColors: true, side: THREE.DoubleSide });
  readonly wire = new THREE.LineBasicMaterial({ color: kWire });
  readonly points: THREE.PointsMaterial;
  readonly plainPoints = new THREE.PointsMaterial({ color: kClay, size: 2, sizeAttenuation: false });
  readonly colouredPoints = new THREE.PointsMaterial({ vertexColors: true, size: 2, sizeAttenuation: false });
  readonly normals = this.byNumber('varying vec3 v;', 'v = normal;', 'vec3 n = normalize(v); gl_FragColor = vec4(vec3(n.x, -n.y, -n.z) * 0.5 + 0.5, 1.0);');
  readonly depth = this.byNumber(
    'varying float v;',
    'v = position.z;',
    'float share = clamp((v - range.x) / (range.y - range.x), 0.0, 1.0); gl_FragColor = texture2D(colours, vec2(share * 255.0 / 256.0 + 0.5 / 256.0, 0.5));',
    'uniform vec2 range; uniform sampler2D colours;',
  );

  /** `antialias`: the card takes several samples a pixel. */
  constructor(
    map: THREE.Texture,
    private readonly antialias: boolean,
  ) {
    this.textured = new THREE.MeshBasicMaterial({ map, side: THREE.DoubleSide });
    this.points = new THREE.PointsMaterial({ map, size: 2, sizeAttenuation: false });
    for (const material of this.all) this.giveLens(material);
  }

  /** The distortion that bends what is drawn; null: none. */
  setLens(camera: Pinhole | null): void {
    const k = camera === null ? [0, 0, 0, 0, 0] : lensOf(camera).distortion;
    this.lens.lens.value.set(k[0]!, k[1]!, k[2]!, k[3]!);
    this.lens.lensRest.value.set(k[4]!, k.some((v) => v !== 0) ? 1 : 0);
  }

  setDepthRange(range: Range): void {
    this.depthRange.value.set(range.from, range.to);
  }

  /** Rims of surfaces with a picture and of lit ones; their geometry then has the numbers of vertexRims(). */
  set smooth(smooth: boolean) {
    if (smooth === this.smooth_) return;
    this.smooth_ = smooth;
    for (const material of [this.textured, this.shaded] as (THREE.Material & { defines?: Record<string, unknown> })[]) {
      material.defines = { ...material.defines };
      if (smooth) material.defines['SMOOTH_RIMS'] = '';
      else delete material.defines['SMOOTH_RIMS'];
      material.alphaToCoverage = smooth && this.antialias;
      material.needsUpdate = true;
    }
  }

  set dimmed(dimmed: boolean) {
    if (dimmed === this.dimmed_) return;
    this.dimmed_ = dimmed;
    for (const material of this.all) {
      material.blending = dimmed ? THREE.CustomBlending : THREE.NormalBlending;
      material.blendSrc = THREE.ConstantAlphaFactor;
      material.blendDst = THREE.OneMinusConstantAlphaFactor;
      material.blendAlpha = kDimmed;
    }
  }

  setPointSize(pixels: number): void {
    this.points.size = this.plainPoints.size = this.colouredPoints.size = pixels;
  }

  dispose(): void {
    for (const material of this.all) material.dispose();
  }

  /** Of a surface with triangles. */
  solid(mode: Mode, has: { texture: boolean; quality: boolean; colours: boolean }): THREE.Material {
    if (mode === 'wireframe') return this.fill;
    if (mode === 'normals') return this.normals;
    if (mode === 'depth') return this.depth;
    if (mode === 'confidence' && has.quality) return this.coloured;
    if (mode === 'textured' && has.texture) return this.textured;
    if (mode === 'textured' && has.colours) return this.coloured;
    return this.shaded;
  }

  cloud(mode: Mode, has: { texture: boolean; quality: boolean; colours: boolean }): THREE.Material {
    if (mode === 'confidence' && has.quality) return this.colouredPoints;
    if (has.texture) return this.points;
    return has.colours ? this.colouredPoints : this.plainPoints;
  }

  private get all(): THREE.Material[] {
    return Object.values(this).filter((part) => part instanceof THREE.Material);
  }

  // Its colours stand for numbers: no light falls on them.
  private byNumber(varying: string, vertex: string, fragment: string, uniforms = ''): THREE.ShaderMaterial {
    return new THREE.ShaderMaterial({
      uniforms: { range: this.depthRange, colours: { value: depthColours() } },
      vertexShader: `${varying} void main() { ${vertex} vec3 transformed = position;\n#include <project_vertex>\n}`,
      fragmentShader: `${varying} ${uniforms} void main() { ${fragment} }`,
      side: THREE.DoubleSide,
    });
  }

  private giveLens(material: THREE.Material): void {
    material.onBeforeCompile = (shader) => {
      Object.assign(shader.uniforms, this.lens);
      shader.vertexShader =
        kLensHead +
        kRimVertexHead +
        shader.vertexShader.replace(
          '#include <project_vertex>',
          `#include <project_vertex>\ngl_Position = projectionMatrix * throughLens(mvPosition);${kRimVertex}`,
        );
      shader.fragmentShader =
        '#ifdef SMOOTH_RIMS\nvarying float rimOf;\n#endif\n' +
        shader.fragmentShader.replace('#include <alphatest_fragment>', `#include <alphatest_fragment>${kRimFragment}`);
    };
    material.customProgramCacheKey = () => 'lens';
  }
}

function depthColours(): THREE.DataTexture {
  const rgba = new Uint8Array(kColours * 4);
  for (let i = 0; i < kColours; ++i) rgba.set([...depthColour(i / (kColours - 1)), 255], i * 4);
  const texture = new THREE.DataTexture(rgba, kColours, 1);
  texture.minFilter = texture.magFilter = THREE.LinearFilter;
  texture.needsUpdate = true;
  return texture;
}
