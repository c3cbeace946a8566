// SPDX-License-Identifier: Apache-2.0
// Proves: the parser reads what codec/FORMAT.md says and refuses everything else.
import { describe, expect, it } from 'vitest';
import { parseFrame } from '../src/frame';

interface Section {
  kind: number;
  codec: number;
  flags?: number;
  bytes: number[];
}

const geometry: Section = { kind: 1, codec: 1, bytes: Array.from({ length: 40 }, (_, i) => i) };
const texture: Section = { kind: 2, codec: 1, bytes: Array.from({ length: 20 }, () => 7) };

/** A frame as FORMAT.md draws it, with room for extensions between the fields and the table and in an entry. */
function build(sections: Section[], extraHeader = 0, entryBytes = 8): Uint8Array {
  const tableAt = 64 + extraHeader;
  const headerBytes = tableAt + sections.length * entryBytes;
  const bytes = new Uint8Array(headerBytes + sections.reduce((sum, s) => sum + s.bytes.length, 0));
  const view = new DataView(bytes.buffer);
  bytes.set([0x52, 0x4c, 0x56, 0x46, 1, 1]);
  view.setUint16(6, headerBytes, true);
  view.setBigUint64(8, 7n, true);
  view.setBigInt64(16, -5n, true);
  view.setFloat32(24, -1, true);
  view.setFloat32(36, 2, true);
  view.setUint32(40, 30, true);
  view.setUint32(44, 40, true);
  view.setUint32(48, sections.some((s) => s.kind === 2) ? 32 : 0, true);
  view.setUint32(52, sections.some((s) => s.kind === 2) ? 16 : 0, true);
  view.setUint8(56, sections.length);
  view.setUint8(57, entryBytes);
  view.setUint16(58, tableAt, true);
  let at = headerBytes;
  sections.forEach((section, i) => {
    const entry = tableAt + i * entryBytes;
    view.setUint8(entry, section.kind);
    view.setUint8(entry + 1, section.codec);
    view.setUint16(entry + 2, section.flags ?? 0, true);
    view.setUint32(entry + 4, section.bytes.length, true);
    bytes.set(section.bytes, at);
    at += section.bytes.length;
  });
  return bytes;
}

const changed = (at: number, ...values: number[]): Uint8Array => {
  const bytes = build([geometry, texture]);
  bytes.set(values, at);
  return bytes;
};

describe('parseFrame', () => {
  it('reads header and sections', () => {
    const frame = parseFrame(build([geometry, texture]));
    expect(frame.header).toMatchObject({
      version: 1,
      number: 7n,
      timeNs: -5n,
      volumeMin: [-1, 0, 0],
      volumeSize: 2,
      vertices: 30,
      triangles: 40,
      textureWidth: 32,
      textureHeight: 16,
    });
    expect([...frame.geometry]).toEqual(geometry.bytes);
    expect([...frame.texture]).toEqual(texture.bytes);
  });

  it('reads a frame that lies behind a prefix', () => {
    const bytes = new Uint8Array([...new Array<number>(48).fill(9), ...build([geometry])]);
    expect(parseFrame(new Uint8Array(bytes.buffer, 48)).header.number).toBe(7n);
  });

  it('steps over what later versions may add', () => {
    const later: Section = { kind: 4, codec: 9, bytes: [1, 2, 3] };
    const frame = parseFrame(build([later, texture, geometry], 24, 12));
    expect([...frame.geometry]).toEqual(geometry.bytes);
    expect(frame.textureCodec).toBe(1);
  });

  it.each([
    ['no magic', changed(0, 0x51), /does not start with RLVF/],
    ['another version', changed(4, 2), /version 2/],
    ['a delta frame', changed(5, 0), /agree/],
    ['an unknown flag', changed(5, 3), /flags/],
    ['a header behind the end', changed(6, 0xff, 0xff), /cut short/],
    ['a volume that is not finite', changed(36, 0, 0, 0xc0, 0x7f), /volume/],
    ['a table inside the fields', changed(58, 60, 0), /table/],
    ['a table behind the header', changed(58, 200, 0), /table/],
    ['too small entries', changed(57, 7), /table/],
    ['too many sections', changed(56, 17), /table/],
    ['too many vertices', changed(40, 0, 0, 0, 0xff), /vertices/],
    ['more triangles than its bytes', changed(44, 0x41, 0x01), /declares/],
    ['more vertices than its triangles', changed(40, 121), /declares/],
    ['more pixels than its bytes', changed(48, 0xff, 0xff), /declares|limit/],
    ['no vertices but bytes', changed(40, 0), /declares/],
    ['two geometries', build([geometry, geometry]), /two sections/],
    ['no geometry', build([texture]), /no geometry/],
    ['a required unknown section', build([geometry, { kind: 3, codec: 1, flags: 1, bytes: [] }]), /kind 3/],
    ['trailing bytes', new Uint8Array([...build([geometry]), 0]), /1 bytes behind/],
  ])('refuses %s', (_, bytes, message) => {
    expect(() => parseFrame(bytes)).toThrow(message);
  });

  it('refuses every shorter frame and never reads outside', () => {
    const whole = build([geometry, texture]);
    for (let length = 0; length < whole.length; ++length) {
      expect(() => parseFrame(whole.slice(0, length)), `${length} bytes`).toThrow(/cut short|RLVF/);
    }
  });

  it('survives random changes', () => {
    let random = 1;
    const next = (): number => (random = (Math.imul(random, 1664525) + 1013904223) >>> 0) >>> 8;
    for (let i = 0; i < 5000; ++i) {
      const bytes = build([geometry, texture]);
      for (let k = 0; k < 4; ++k) bytes[next() % bytes.length] = next() & 255;
      try {
        const frame = parseFrame(bytes);
        expect(frame.geometry.byteOffset + frame.geometry.length).toBeLessThanOrEqual(bytes.length);
      } catch (error) {
        expect((error as Error).message).toMatch(/frame/);
      }
    }
  });
});
