// SPDX-License-Identifier: Apache-2.0
// Entropy decoding of the stripe grid: codec/FORMAT.md, "Symbols". Pure.

const kScaleBits = 11;
export const kScale = 1 << kScaleBits;
const kMask = kScale - 1;
const kLow = 1 << 15;
export const kMostSymbols = 72;
const kLargestLevel = 23;

const damaged = (): Error => new Error('geometry is damaged');

/** Least significant bit first. Throws behind the end. */
export class BitReader {
  private bits = 0;
  private held = 0;
  position = 0;

  constructor(private readonly bytes: Uint8Array) {}

  /** At most 32 bits. */
  get(count: number): number {
    if (count > 16) return this.get(16) + this.get(count - 16) * 65536;
    while (this.held < count) {
      if (this.position >= this.bytes.length) throw damaged();
      this.bits |= this.bytes[this.position++]! << this.held;
      this.held += 8;
    }
    const value = this.bits & ((1 << count) - 1);
    this.bits >>>= count;
    this.held -= count;
    return value;
  }

  unary(most: number): number {
    let value = 0;
    while (this.get(1) === 1) if (++value > most) throw damaged();
    return value;
  }
}

/** How often each symbol comes, in half octaves; 0: never. */
export function readLevels(bits: BitReader): Uint8Array {
  const levels = new Uint8Array(kMostSymbols);
  const count = Math.min(bits.get(7), kMostSymbols);
  for (let s = 0, level = 0; s < count; ++s) {
    if (s === 0) {
      level = bits.get(5);
    } else {
      const folded = bits.unary(2 * kLargestLevel);
      level += folded & 1 ? -((folded + 1) >> 1) : folded >> 1;
    }
    level = Math.min(Math.max(level, 0), kLargestLevel);
    levels[s] = level;
  }
  return levels;
}

const weight = (level: number): number => (level & 1 ? 16 : 23) << ((level - 1) >> 1);

/** With the sum kScale; all 0 where no symbol has a level. */
export function frequencies(levels: Uint8Array): Uint16Array {
  const out = new Uint16Array(kMostSymbols);
  let sum = 0;
  for (const level of levels) if (level > 0) sum += weight(level);
  if (sum === 0) return out;
  let left = kScale;
  levels.forEach((level, s) => {
    if (level === 0) return;
    out[s] = Math.max(Math.floor((weight(level) * kScale) / sum), 1);
    left -= out[s]!;
  });
  while (left !== 0) {
    let most = 0;
    for (let s = 1; s < out.length; ++s) if (out[s]! > out[most]!) most = s;
    const change = left > 0 ? left : -Math.min(-left, out[most]! >> 1);
    out[most] = out[most]! + change;
    left -= change;
  }
  return out;
}

/** A slot: 8 bits of symbol, 12 of its frequency, 12 of the place among the symbol's own. Null: not usable. */
export type Table = Uint32Array | null;

export function tableOf(levels: Uint8Array): Table {
  const slots = new Uint32Array(kScale);
  let at = 0;
  frequencies(levels).forEach((f, s) => {
    for (let i = 0; i < f; ++i) slots[at++] = (s | (f << 8) | (i << 20)) >>> 0;
  });
  return at === kScale ? slots : null;
}

/** Of the first of two symbols, of kScale; 0 where the alphabet is not used. */
export function readFirstFrequency(bits: BitReader): number {
  if (bits.get(1) === 0) return 0;
  const secondIsRare = bits.get(1) === 1;
  const level = Math.min(bits.get(5), 21);
  const rare = level === 0 ? 0 : weight(level) >> 4;
  return secondIsRare ? kScale - rare : rare;
}

/** One state per lane, words of 16 bits. Throws where the stream ends too early. */
export class Decoder {
  private readonly states: Int32Array;
  private at: number;

  constructor(
    private readonly bytes: Uint8Array,
    private readonly lanes: number,
  ) {
    if (bytes.length < 4 * lanes) throw damaged();
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    this.states = new Int32Array(lanes);
    for (let lane = 0; lane < lanes; ++lane) this.states[lane] = view.getUint32(4 * lane, true) & 0x7fffffff;
    this.at = 4 * lanes;
  }

  /** One row: `count` symbols, each from the table of its number; the lanes take turns from the first on. */
  row(tables: readonly Table[], numbers: Uint8Array, count: number, out: Uint8Array): void {
    const { bytes, states } = this;
    const mask = this.lanes - 1;
    let at = this.at;
    for (let i = 0; i < count; ++i) {
      const table = tables[numbers[i]!];
      if (table === null || table === undefined) throw damaged();
      let x = states[i & mask]!;
      const slot = table[x & kMask]!;
      x = Math.imul((slot >>> 8) & 0xfff, x >>> kScaleBits) + (slot >>> 20);
      if (x < kLow) {
        x = (x << 16) | bytes[at]! | (bytes[at + 1]! << 8);
        at += 2;
      }
      states[i & mask] = x;
      out[i] = slot;
    }
    if (at > bytes.length) throw damaged();
    this.at = at;
  }

  /** The next symbol of a stream with one lane. */
  one(table: Table): number {
    if (table === null) throw damaged();
    let x = this.states[0]!;
    const slot = table[x & kMask]!;
    x = Math.imul((slot >>> 8) & 0xfff, x >>> kScaleBits) + (slot >>> 20);
    this.states[0] = this.refill(x);
    return slot & 255;
  }

  /** The same of an alphabet of two. */
  two(first: number): number {
    let x = this.states[0]!;
    const slot = x & kMask;
    const second = slot >= first;
    x = Math.imul(second ? kScale - first : first, x >>> kScaleBits) + (second ? slot - first : slot);
    this.states[0] = this.refill(x);
    return second ? 1 : 0;
  }

  private refill(x: number): number {
    if (x >= kLow) return x;
    if (this.at + 2 > this.bytes.length) throw damaged();
    const word = this.bytes[this.at]! | (this.bytes[this.at + 1]! << 8);
    this.at += 2;
    return (x << 16) | word;
  }

  /** All was read, and read rightly. */
  get finished(): boolean {
    return this.at === this.bytes.length && this.states.every((x) => x === kLow);
  }
}
