// SPDX-License-Identifier: Apache-2.0
// How a surface's rims are drawn. They end where the last stripe was found, so they run in steps of a stripe's width
// although what they show does not. Nothing is added there: parts of the outermost triangles are left out. Pure.

/** What is drawn of a surface is where the numbers of vertexRims(), between its vertices, are above this. */
export const kRimCut = 0.5;

const kKept = 0.85; // of the line before: steps of about as many lines as 1 / (1 - kKept) become slopes
const kAlone = 0.7; // no inner vertex is near: all is drawn
const kInside = 0.55; // at least, so that what is left out is of the outermost triangles alone

// Used again for each frame: new memory of this size costs the browser more time than the rest.
let scratch = { open: new Int32Array(0), inside: new Float32Array(0), down: new Float32Array(0), edges: new Uint32Array(0) };

function scratchFor(vertices: number, triangles: number): typeof scratch {
  if (scratch.open.length < vertices || scratch.edges.length < 2 * triangles) {
    const room = Math.ceil(1.3 * vertices);
    const [inside, down] = [new Float32Array(room), new Float32Array(room)];
    scratch = { open: new Int32Array(room), inside, down, edges: new Uint32Array(Math.ceil(2.6 * triangles)) };
  }
  return scratch;
}

/**
 * Of each vertex: how far it is inside, 0 to 1. `coordinates` are places in the picture, and triangles come line by line,
 * as grids do; where they do not, rims are less smooth. `memory` is what the numbers go into.
 */
export function vertexRims(
  coordinates: Float32Array,
  triangles: Uint32Array,
  memory = (count: number): Float32Array<ArrayBuffer> => new Float32Array(count),
): Float32Array<ArrayBuffer> {
  const vertices = coordinates.length / 2;
  const { open, inside, down, edges } = scratchFor(vertices, triangles.length / 3);
  findInside(vertices, triangles, open, inside);
  const ends = findUpright(coordinates, triangles, edges);
  for (let v = 0; v < vertices; ++v) down[v] = inside[v]!;
  for (let e = 0; e < ends; e += 2) {
    const lower = edges[e + 1]!;
    down[lower] = (1 - kKept) * inside[lower]! + kKept * down[edges[e]!]!;
  }
  const up = memory(vertices);
  for (let v = 0; v < vertices; ++v) up[v] = inside[v]!;
  for (let e = ends - 2; e >= 0; e -= 2) {
    const upper = edges[e]!;
    up[upper] = (1 - kKept) * inside[upper]! + kKept * up[edges[e + 1]!]!;
  }
  for (let v = 0; v < vertices; ++v) {
    const mean = (up[v]! + down[v]!) / 2;
    up[v] = inside[v] === 1 ? Math.max(kInside, mean) : mean;
  }
  return up;
}

/** 1 within a closed fan of triangles, 0 on the rim, kAlone where no vertex next to those beside it is within. */
function findInside(vertices: number, triangles: Uint32Array, open: Int32Array, inside: Float32Array): void {
  // Around a vertex within, each neighbour follows one triangle and precedes another: their numbers cancel.
  open.fill(0, 0, vertices);
  for (let t = 0; t < triangles.length; t += 3) {
    const a = triangles[t]!;
    const b = triangles[t + 1]!;
    const c = triangles[t + 2]!;
    open[a] = open[a]! + c - b;
    open[b] = open[b]! + a - c;
    open[c] = open[c]! + b - a;
  }
  const alone = Math.fround(kAlone);
  inside.fill(alone, 0, vertices);
  for (let t = 0; t < triangles.length; t += 3) {
    const a = triangles[t]!;
    const b = triangles[t + 1]!;
    const c = triangles[t + 2]!;
    if (open[a] !== 0 && open[b] !== 0 && open[c] !== 0) continue;
    inside[a] = open[a] === 0 ? 1 : 0;
    inside[b] = open[b] === 0 ? 1 : 0;
    inside[c] = open[c] === 0 ? 1 : 0;
  }
  // The corner of a step touches none within, but what does.
  for (let t = 0; t < triangles.length; t += 3) {
    let touches = false;
    for (let i = 0; i < 3; ++i) touches ||= inside[triangles[t + i]!]! === 0 || inside[triangles[t + i]!]! === 1;
    if (!touches) continue;
    for (let i = 0; i < 3; ++i) if (inside[triangles[t + i]!]! === alone) inside[triangles[t + i]!] = -1;
  }
  for (let v = 0; v < vertices; ++v) if (inside[v] === -1) inside[v] = 0;
}

/** Pairs, upper vertex first: of each triangle the edge that runs most upright in the picture. How many numbers. */
function findUpright(coordinates: Float32Array, triangles: Uint32Array, edges: Uint32Array): number {
  let ends = 0;
  for (let t = 0; t < triangles.length; t += 3) {
    let best = Infinity;
    for (let i = 0; i < 3; ++i) {
      const a = triangles[t + i]!;
      const b = triangles[t + ((i + 1) % 3)]!;
      const aside = Math.abs(coordinates[2 * a]! - coordinates[2 * b]!);
      const below = coordinates[2 * b + 1]! - coordinates[2 * a + 1]!;
      const slant = below === 0 ? Infinity : aside / Math.abs(below);
      if (slant >= best) continue;
      best = slant;
      edges[ends] = below > 0 ? a : b;
      edges[ends + 1] = below > 0 ? b : a;
    }
    if (best < Infinity) ends += 2;
  }
  return ends;
}
