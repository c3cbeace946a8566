// SPDX-License-Identifier: Apache-2.0
// Vertex quality codec 1 of codec/FORMAT.md: how exact each vertex is, told in the order of the vertices' places in
// the picture. Pure.

export interface VertexQuality {
  sigmas: Float32Array<ArrayBuffer>; // standard deviation of each vertex's depth, metres; 0: not known
  interpolated: Uint8Array<ArrayBuffer>; // 1: not measured, but between measured points
}

const kLargestCode = 63;
const kHeaderBytes = 5;

class BitReader {
  private left = 0;
  private byte = 0;
  private sum = 2;
  private count = 1;

  constructor(
    private readonly bytes: Uint8Array,
    private at: number,
  ) {}

  get atEnd(): boolean {
    return this.at === this.bytes.length;
  }

  bit(): number {
    if (this.left === 0) {
      const next = this.bytes[this.at++];
      if (next === undefined) throw new Error('vertex quality is cut short');
      this.byte = next;
      this.left = 8;
    }
    return (this.byte >> --this.left) & 1;
  }

  bits(count: number, value = 0): number {
    for (let i = 0; i < count; ++i) value = value * 2 + this.bit();
    return value;
  }

  gamma(): number {
    let bits = 0;
    while (this.bit() === 0) if (++bits >= 31) throw new Error('vertex quality is damaged');
    return this.bits(bits, 1);
  }

  /** Golomb-Rice with a parameter that follows the mean. */
  adaptive(most: number): number {
    let k = 0;
    while (this.count * 2 ** k < this.sum) ++k;
    let value = 0;
    while (this.bit() === 1) if (++value * 2 ** k > most) throw new Error('vertex quality is damaged');
    value = this.bits(k, value);
    if (value > most) throw new Error('vertex quality is damaged');
    this.sum += value;
    if (++this.count >= 64) {
      this.sum = Math.floor(this.sum / 2);
      this.count = Math.floor(this.count / 2);
    }
    return value;
  }
}

/** Of the geometry's texture coordinates, two a vertex. Throws where the section is not of this geometry; any input. */
export function decodeVertexQuality(section: Uint8Array, coordinates: Float32Array): VertexQuality {
  const vertices = coordinates.length / 2;
  if (section.length < kHeaderBytes) throw new Error('vertex quality is cut short');
  const view = new DataView(section.buffer, section.byteOffset, section.byteLength);
  const bits = view.getUint8(0);
  const places = view.getUint32(1, true);
  const possible = bits >= 8 && bits <= 16 && places > 0 && places <= vertices;
  if (!possible || places > 8 * (section.length - kHeaderBytes)) throw new Error('vertex quality is damaged');

  const { order, key } = byPlace(coordinates, bits);
  const reader = new BitReader(section, kHeaderBytes);
  const flags = new Uint8Array(places);
  for (let i = 0, flag = 0; i < places; flag ^= 1) {
    const run = reader.gamma() - 1;
    if (run > places - i || (run === 0 && i > 0)) throw new Error('vertex quality is damaged');
    flags.fill(flag, i, i + run);
    i += run;
  }
  const codes = new Uint8Array(places);
  for (let i = 0, code = 0; i < places; ++i) {
    const folded = reader.adaptive(2 * kLargestCode);
    code += folded & 1 ? -(folded + 1) / 2 : folded / 2;
    if (code < 0 || code > kLargestCode) throw new Error('vertex quality is damaged');
    codes[i] = code;
  }
  if (!reader.atEnd) throw new Error('vertex quality goes on behind its end');

  const sigmas = new Float32Array(vertices);
  const interpolated = new Uint8Array(vertices);
  let place = -1;
  for (let i = 0, last = -1; i < vertices; ++i) {
    const v = order[i]!;
    if (key[v] !== last) {
      last = key[v]!;
      if (++place >= places) break;
    }
    const code = codes[place]!;
    sigmas[v] = code === 0 ? 0 : 1e-6 * 2 ** ((code - 1) / 4);
    interpolated[v] = flags[place]!;
  }
  if (place + 1 !== places) throw new Error('vertex quality is of another surface');
  return { sigmas, interpolated };
}

/** Vertices by rising place: column, then row, each by counting. */
function byPlace(coordinates: Float32Array, bits: number): { order: Uint32Array; key: Uint32Array } {
  const vertices = coordinates.length / 2;
  const largest = 2 ** bits - 1;
  const key = new Uint32Array(vertices);
  let order = new Uint32Array(vertices);
  let other = new Uint32Array(vertices);
  for (let v = 0; v < vertices; ++v) {
    const u = Math.floor(coordinates[2 * v]! * largest + 0.5);
    const w = Math.floor(coordinates[2 * v + 1]! * largest + 0.5);
    key[v] = w * 2 ** bits + u;
    order[v] = v;
  }
  const start = new Uint32Array(2 ** bits + 1);
  for (let shift = 0; shift < 2 * bits; shift += bits) {
    start.fill(0);
    const digit = (v: number): number => (key[v]! >>> shift) & largest;
    for (const v of order) start[digit(v) + 1]!++;
    for (let i = 1; i < start.length; ++i) start[i]! += start[i - 1]!;
    for (const v of order) other[start[digit(v)]!++] = v;
    [order, other] = [other, order];
  }
  return { order, key };
}

export const kBestSigma = 20e-6; // metres: green
export const kWorstSigma = 2e-3; // red, in between yellow
const kUnknown = [0.45, 0.45, 0.5] as const;
const kDimmed = 0.6; // of what is interpolated
const kOctaves = Math.log2(kWorstSigma / kBestSigma);

/** Linear RGB of a standard deviation: green where the depth is known to 20 micrometres, red from 2 mm, grey for 0: unknown. */
export function confidenceColour(sigma: number): readonly [number, number, number] {
  if (!(sigma > 0)) return kUnknown;
  const share = Math.min(1, Math.max(0, Math.log2(sigma / kBestSigma) / kOctaves));
  return [Math.min(1, 2 * share), Math.min(1, 2 - 2 * share), 0.05];
}

/** A colour a vertex; darker where it is interpolated. */
export function confidenceColours({ sigmas, interpolated }: VertexQuality): Float32Array<ArrayBuffer> {
  const colours = new Float32Array(sigmas.length * 3);
  for (let v = 0; v < sigmas.length; ++v) {
    const [r, g, b] = confidenceColour(sigmas[v]!);
    const light = interpolated[v] === 1 ? kDimmed : 1;
    colours[3 * v] = r * light;
    colours[3 * v + 1] = g * light;
    colours[3 * v + 2] = b * light;
  }
  return colours;
}
