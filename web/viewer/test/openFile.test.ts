// SPDX-License-Identifier: Apache-2.0
// Proves: files that are damaged, empty, too large or none are refused in words of strings.ts, at once, whatever they announce;
// what is whole of a recording that was cut is still there.
import { McapWriter } from '@mcap/core';
import { afterAll, beforeAll, describe, expect, it, vi } from 'vitest';
import { writeFrame } from '../src/cdrWriter';
import { writeGlb } from '../src/exportGlb';
import { writePly } from '../src/exportPly';
import { FileError } from '../src/fileError';
import { kMaxSurfaceBytes, openFile, openRemote, type Opened } from '../src/openFile';
import { bytesOf } from '../src/mcap';
import { Recording } from '../src/recording';
import type { Fetch } from '../src/remoteFile';
import { text } from '../src/strings';

const say = text.file;
const surface = {
  positions: new Float32Array([0, 0, 1, 0.5, 0, 1, 0.5, 0.5, 2]),
  coordinates: null,
  triangles: new Uint32Array([0, 1, 2]),
  quality: null,
};
const png = Uint8Array.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0, 0, 0, 13, ...new Array<number>(400).fill(7)]);

type Content = Uint8Array | string;
const bytes = (content: Content): Uint8Array<ArrayBuffer> =>
  typeof content === 'string' ? new TextEncoder().encode(content) : content.slice();
const open = (name: string, ...content: Content[]): Promise<Opened> => openFile([new File(content.map(bytes), name)]);
const refused = (name: string, words: string, ...content: Content[]): Promise<void> =>
  expect(open(name, ...content), name).rejects.toThrow(new FileError(words));

// What three's loaders think of such files.
beforeAll(() => ['error', 'warn', 'log'].forEach((name) => vi.spyOn(console, name as 'log').mockImplementation(() => undefined)));
afterAll(() => vi.restoreAllMocks());

describe('any file', () => {
  it.each(['a.mcap', 'a.ply', 'A.GLB'])('that is empty says so: %s', (name) => refused(name, say.empty));
  it('of another kind names those that can be shown', () => refused('a.obj', say.otherKind, 'v 0 0 0'));
  it('that cannot be read any more says so', async () => {
    const gone = Object.assign(new File(['ply'], 'gone.ply'), {
      arrayBuffer: () => Promise.reject(new DOMException('A requested file could not be found', 'NotFoundError')),
    });
    await expect(openFile([gone])).rejects.toThrow(new FileError(say.unreadable));
  });
  it('of a surface that is too large is not read', async () => {
    const size = kMaxSurfaceBytes + 1;
    const large = { name: 'a.ply', size, arrayBuffer: () => Promise.reject(new Error('it was read')) } as unknown as File;
    await expect(openFile([large])).rejects.toThrow(new FileError(say.tooLarge(size, kMaxSurfaceBytes)));
  });
});

describe('a PLY of another program', () => {
  const of = (property: string, value: string): string =>
    `ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n${property}end_header\n0 0 1${value}\n`;
  const qualityOf = async (content: string): Promise<unknown> => {
    const opened = await open('a.ply', content);
    return opened.kind === 'surface' ? opened.frame.quality : opened.kind;
  };
  it('says nothing of how exact it is, and nothing is said', async () => expect(await qualityOf(of('', ''))).toBeNull());
  it('that says it is heeded', async () =>
    expect(await qualityOf(of('property float sigma\n', ' 0.5'))).toEqual({ sigmas: Float32Array.of(0.5), interpolated: Uint8Array.of(0) }));
});

describe('a picture with another name', () => {
  it('is no recording', () => refused('a.mcap', say.noMcap, png));
  it('is no PLY', () => refused('a.ply', say.noPly, png));
  it('is no GLB', () => refused('a.glb', say.noGlb, png));
});

describe('a recording', () => {
  async function recording(frames: number): Promise<Uint8Array> {
    const parts: Uint8Array[] = [];
    const position = (): bigint => BigInt(parts.reduce((sum, part) => sum + part.length, 0));
    const writer = new McapWriter({ writable: { position, write: async (part) => void parts.push(part.slice()) }, chunkSize: 20_000 });
    await writer.start({ profile: '', library: 'test' });
    const channelId = await writer.registerChannel({ topic: 'relievo/frame', schemaId: 0, messageEncoding: 'cdr', metadata: new Map() });
    const data = new Uint8Array(5000);
    data.set([0x52, 0x4c, 0x56, 0x46, 1, 1]);
    for (let i = 0; i < frames; ++i) {
      const times = { logTime: BigInt(i) * 33_000_000n, publishTime: BigInt(i) * 33_000_000n };
      const frame = writeFrame({ stream: 'face', sequence: BigInt(i), number: BigInt(i), captureNs: 0n, publishNs: 0n, data });
      await writer.addMessage({ channelId, sequence: i, ...times, data: frame });
    }
    await writer.end();
    return new Uint8Array(Buffer.concat(parts));
  }

  it('cut in the middle has what is whole, and says so', async () => {
    const whole = await recording(40);
    const opened = await open('a.mcap', whole.subarray(0, whole.length / 2));
    expect(opened).toMatchObject({ kind: 'recording', note: expect.stringMatching(/cut short/) });
    const { count } = await Recording.open(bytesOf(new Blob([whole.slice(0, whole.length / 2)])));
    expect(count).toBeGreaterThan(10);
    expect(count).toBeLessThan(25);
    await refused('a.mcap', say.noWholeFrame, whole.subarray(0, 1000)); // cut within its first chunk
    await refused('a.mcap', say.noWholeFrame, whole.subarray(0, 8));
  });
  it('that was cut short says so also where the server gives it an index', async () => {
    const whole = await recording(10);
    const noteOf = async (etag: string): Promise<string | null> => {
      const fetch: Fetch = async (_, init) => {
        const [from, to] = /(\d+)-(\d+)/.exec(new Headers(init.headers).get('range')!)!.slice(1).map(Number) as [number, number];
        const headers = { 'content-range': `bytes ${from}-${to}/${whole.length}`, etag };
        return new Response(whole.slice(from, to + 1), { status: 206, headers });
      };
      return (await openRemote(new URL('http://host/a.mcap'), fetch)).note;
    };
    expect(await noteOf('"cut-1-2"')).toBe(say.wasCut);
    expect(await noteOf('"1-2-3"')).toBeNull();
  });
  it('of something else says so', async () => {
    await refused('a.mcap', say.noFrames, await recording(0));
  });
  it('with bytes that make no sense holds nothing that is whole', async () => {
    const magic = Uint8Array.from([0x89, 0x4d, 0x43, 0x41, 0x50, 0x30, 0x0d, 0x0a]);
    const channel = Uint8Array.from([4, 1, 0, 0, 0, 0, 0, 0, 0, 9]); // of one byte
    await refused('a.mcap', say.noWholeFrame, magic, channel, magic);
    await refused('a.mcap', say.noWholeFrame, magic, new Uint8Array(3000).fill(0xff));
  });
});

describe('a PLY', () => {
  const header = (...lines: string[]): string => ['ply', ...lines, 'end_header', ''].join('\n');
  const xyz = ['property float x', 'property float y', 'property float z'];
  const list = 'property list uchar int vertex_indices';
  const binary = 'format binary_little_endian 1.0';
  const sound = writePly(surface, null);

  it('that is sound is shown', async () => {
    const opened = await open('a.ply', sound);
    expect(opened.kind === 'surface' && [...opened.frame.triangles]).toEqual([0, 1, 2]);
    const words = await open('a.ply', header('format ascii 1.0', 'element vertex 3', ...xyz, 'element face 1', list), '0 0 0 1 0 0 1 1 0\n3 0 1 2\n');
    expect(words.kind === 'surface' && [...words.frame.triangles]).toEqual([0, 1, 2]);
  });

  it.each([3, 20, sound.length - 70, sound.length - 14, sound.length - 1])('that ends after %d bytes says that it was cut', async (length) => {
    await refused('a.ply', say.cutShort, sound.subarray(0, length));
  });

  it.each(['4', '4000000000', '1e99', '-1', 'many', ''])('that announces %s vertices and has 3 is refused at once', async (count) => {
    for (const format of [binary, 'format ascii 1.0', 'format binary_big_endian 1.0']) {
      const words = /^\d+$/.test(count) ? say.cutShort : say.damaged;
      await refused('a.ply', words, header(format, `element vertex ${count}`, ...xyz), new Uint8Array(36).fill(32));
    }
  });

  it('does not count to a thousand million for what takes no room', async () => {
    for (const format of [binary, 'format ascii 1.0']) {
      await refused('a.ply', say.cutShort, header(format, 'element nothing 4000000000', 'element vertex 1', ...xyz), new Uint8Array(12));
    }
  });

  it('with lists that go on behind its end was cut', async () => {
    const face = Uint8Array.from([0xff, 0xff, 0xff, 0xff, 0, 0, 0, 0]);
    const lines = [binary, 'element vertex 1', ...xyz, 'element face 1', 'property list uint int vertex_indices'];
    await refused('a.ply', say.cutShort, header(...lines), new Uint8Array(12), face);
    await refused('a.ply', say.cutShort, header('format ascii 1.0', 'element vertex 1', ...xyz, 'element face 1', list), '0 0 0\n3 0 0');
  });

  it('with faces of vertices that it has not is damaged', async () => {
    const broken = sound.slice();
    new DataView(broken.buffer).setInt32(broken.length - 4, 77, true);
    await refused('a.ply', say.damaged, broken);
  });

  it('of unknown types, formats or without a place is damaged', async () => {
    await refused('a.ply', say.damaged, header(binary, 'element vertex 1', 'property float16 x'), new Uint8Array(12));
    await refused('a.ply', say.damaged, header('format morse 1.0', 'element vertex 1', ...xyz), new Uint8Array(12));
    await refused('a.ply', say.damaged, header(binary, 'property float x', 'element vertex 1'), new Uint8Array(12));
    await refused('a.ply', say.damaged, header(binary, 'element vertex 1', 'property float u'), new Uint8Array(4));
    await refused('a.ply', say.damaged, header(binary, 'element vertex 1', ...xyz), new Uint8Array(new Float32Array([NaN, 0, 0]).buffer));
    await refused('a.ply', say.damaged, header(binary, 'element vertex 1', ...xyz, 'element face 1', 'property uchar flags'), new Uint8Array(13));
  });

  it('without vertices has no surface', async () => {
    await refused('a.ply', say.noSurface, header(binary, 'element vertex 0', ...xyz));
    await refused('a.ply', say.noSurface, header(binary));
  });
});

describe('a GLB', () => {
  const sound = writeGlb(surface, null);
  const word = (...values: number[]): Uint8Array => new Uint8Array(Uint32Array.from(values).buffer);
  const glb = (json: unknown, bin = new Uint8Array(0)): Uint8Array => {
    const chunk = new TextEncoder().encode(typeof json === 'string' ? json : JSON.stringify(json));
    const padded = new Uint8Array(Math.ceil(chunk.length / 4) * 4).fill(0x20);
    padded.set(chunk);
    const body = bin.length === 0 ? [] : [word(bin.length, 0x004e4942), bin];
    const length = 20 + padded.length + body.reduce((sum, part) => sum + part.length, 0);
    return new Uint8Array(Buffer.concat([word(0x46546c67, 2, length, padded.length, 0x4e4f534a), padded, ...body]));
  };
  const asset = { version: '2.0' };
  const scene = (position: object, more: object = {}): object => ({
    asset,
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0 }, mode: 0 }] }],
    accessors: [{ componentType: 5126, type: 'VEC3', count: 3, ...position }],
    ...more,
  });

  it('that is sound is shown', async () => {
    const opened = await open('a.glb', sound);
    expect(opened.kind === 'surface' && [...opened.frame.positions].map((c) => c + 0)).toEqual([...surface.positions]);
  });

  it.each([2, 10, 19, 300, sound.length - 1])('that ends after %d bytes says that it was cut', async (length) => {
    await refused('a.glb', length < 4 ? say.noGlb : say.cutShort, sound.subarray(0, length));
  });

  it.each([0xffffffff, sound.length, 2 ** 31])('with a chunk of %d bytes is refused at once', async (length) => {
    const broken = sound.slice();
    new DataView(broken.buffer).setUint32(12, length, true);
    await refused('a.glb', say.damaged, broken);
  });

  it('of glTF 1, or without sense, says so', async () => {
    const old = sound.slice();
    new DataView(old.buffer).setUint32(4, 1, true);
    await refused('a.glb', say.oldGlb, old);
    for (const json of ['{', 'null', '7', {}, { asset: {} }, scene({}, { scenes: 5 }), scene({}, { scene: 3 })]) {
      await refused('a.glb', say.damaged, glb(json));
    }
    await refused('a.glb', say.damaged, word(0x46546c67, 2, 12));
  });

  it('without meshes has no surface', async () => {
    await refused('a.glb', say.noSurface, glb({ asset }));
    await refused('a.glb', say.noSurface, glb({ asset, scene: 0, scenes: [{ nodes: [0] }], nodes: [{ name: 'a lamp' }] }));
    await refused('a.glb', say.noSurface, glb(scene({ bufferView: 0, count: 0 }, { buffers: [{ byteLength: 4 }], bufferViews: [{ buffer: 0, byteLength: 4 }] }), new Uint8Array(4)));
  });

  it('that announces more than it has is refused before anything is made for it', async () => {
    await refused('a.glb', say.damaged, glb(scene({ count: 1e9 })));
    await refused('a.glb', say.damaged, glb(scene({ count: 1e9, sparse: { count: 1 } })));
    const views = { buffers: [{ byteLength: 36 }], bufferViews: [{ buffer: 0, byteLength: 36 }] };
    await refused('a.glb', say.damaged, glb(scene({ bufferView: 0, count: 1e9 }, views), new Uint8Array(36)));
    await refused('a.glb', say.damaged, glb(scene({ bufferView: 0 }, { ...views, buffers: [{ byteLength: 3e9 }] }), new Uint8Array(36)));
    await refused('a.glb', say.damaged, glb(scene({ bufferView: 0 }, { ...views, bufferViews: [{ buffer: 0, byteLength: 3e9 }] }), new Uint8Array(36)));
  });

  it('whose nodes hold each other is refused, where its reader would wait for ever', async () => {
    await refused('a.glb', say.damaged, glb(scene({}, { nodes: [{ children: [1] }, { children: [0], mesh: 0 }] })));
    await refused('a.glb', say.damaged, glb(scene({}, { nodes: [{ children: [0], mesh: 0 }] })));
  });

  it('of several files names them as the reason', async () => {
    await refused('a.glb', say.elsewhere, glb(scene({}, { buffers: [{ byteLength: 36, uri: 'mesh.bin' }] })));
  });
});
