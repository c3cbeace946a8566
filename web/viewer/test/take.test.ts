// SPDX-License-Identifier: Apache-2.0
// Proves: a link brings back what it was made of, whatever else is in it; what is written can be read again.
import { describe, expect, it } from 'vitest';
import type { BufferGeometry, Mesh, MeshBasicMaterial } from 'three';
import { GLTFLoader } from 'three/examples/jsm/loaders/GLTFLoader.js';
import { PLYLoader } from 'three/examples/jsm/loaders/PLYLoader.js';
import { kDefaultDisplay } from '../src/display';
import { fileName } from '../src/download';
import { writeGlb } from '../src/exportGlb';
import { writePly } from '../src/exportPly';
import type { Surface } from '../src/pick';
import { rigidOf } from '../src/rigid';
import { momentOf, namesOf, readShared, shareLink, type Measured } from '../src/share';
import type { Moment, Playback } from '../src/source';

const surface: Surface = {
  positions: new Float32Array([0, 0, 1, 0.5, 0, 1, 0.5, 0.5, 2]),
  coordinates: new Float32Array([0, 0, 1, 0, 1, 1]),
  triangles: new Uint32Array([0, 1, 2]),
  quality: { sigmas: new Float32Array([1e-4, 2e-4, 0]), interpolated: new Uint8Array([0, 1, 0]) },
};
const picture = { width: 2, height: 1, rgba: new Uint8ClampedArray([255, 0, 0, 255, 0, 0, 255, 255]) };

describe('the name of what is saved', () => {
  it('is of what is shown, in any script, without what names a kind of file', () => {
    expect(fileName('face', 123, 'ply')).toBe('relievo-face-000123.ply');
    expect(fileName('face.v2.mcap', 7, 'png')).toBe('relievo-face.v2-000007.png');
    expect(fileName('קובץ 12.mcap', null, 'mcap')).toBe('relievo-קובץ_12.mcap');
    expect(fileName('顔.PLY', null, 'csv')).toBe('relievo-顔.csv');
    expect(fileName('cafe\u0301.glb', null, 'png')).toBe('relievo-caf\u00e9.png');
  });

  it('has nothing in it that no file may have', () => {
    expect(fileName('a/b\\c:"d"<e>\u202e.mcap', null, 'png')).toBe('relievo-a_b_c_d_e.png');
    for (const nothing of [null, '', '.mcap', '???']) expect(fileName(nothing, null, 'png')).toBe('relievo-surface.png');
    expect(new TextEncoder().encode(fileName('顔'.repeat(300), 1, 'ply')).length).toBeLessThan(256);
    expect(fileName('a'.repeat(300), 1, 'ply').length).toBeLessThan(128);
  });
});

describe('a link', () => {
  const nothing: Measured = { measurements: [], flatness: null };
  const display = { ...kDefaultDisplay, mode: 'depth' as const, grid: false, fov: 30, theme: 'light' as const };
  const pose = { position: [0.1, -0.25, 1.5], target: [0, 0, -1] } as { position: [number, number, number]; target: [number, number, number] };

  it('brings back stream, display and view, but not the theme', () => {
    const link = new URL(shareLink('http://host:8080/?stream=old&x=1#mode=points', { kind: 'stream', name: 'face' }, display, pose, 'live'));
    expect(link.searchParams.get('stream')).toBe('face');
    expect([...link.searchParams.keys()]).toEqual(['stream']);
    const shared = readShared(link.hash, kDefaultDisplay);
    expect(shared.display).toEqual({ ...display, theme: 'auto' });
    expect(shared.pose).toEqual(pose);
    expect(new URLSearchParams(link.hash.slice(1)).get('time')).toBe('live');
    expect(shared.moment).toBeNull();
  });

  it('brings back where streams were placed', () => {
    const places = new Map([['left_one', rigidOf([0.1, -0.8, 0.05], [0.9, -0.02, 0.3])]]);
    const link = new URL(shareLink('http://host/', { kind: 'stream', name: 'face,left_one' }, kDefaultDisplay, null, null, places));
    const back = readShared(link.hash, kDefaultDisplay).places.get('left_one')!;
    back.rotation.forEach((c, i) => expect(c).toBeCloseTo(places.get('left_one')!.rotation[i]!, 4));
    expect(back.translation).toEqual([0.9, -0.02, 0.3]);
    for (const hash of ['#place=a', '#place=a_1_2_3_4_5', '#place=_1_2_3_4_5_6', '#place=a_1_2_3_4_5_x', '#place=a_1_2_3_4_5_1e9']) {
      expect(readShared(hash, kDefaultDisplay).places.size).toBe(0);
    }
  });

  const recording = { kind: 'recording', name: 'face-2026-11-22T07-05-00Z.mcap' } as const;
  const momentBack = (moment: Moment): Moment | null =>
    readShared(new URL(shareLink('http://host/', recording, display, null, moment)).hash, kDefaultDisplay).moment;

  it('brings back the time, not before the frame that is there since a part of a millisecond', () => {
    expect(momentBack({ atMs: 166.333, utc: false, playing: false })).toEqual({ atMs: 167, utc: false, playing: false });
    expect(momentBack({ atMs: 3_600_000, utc: false, playing: true })).toEqual({ atMs: 3_600_000, utc: false, playing: true });
    expect(momentBack({ atMs: 1_795_338_300_000.25, utc: true, playing: false })?.atMs).toBe(1_795_338_300_001);
    expect(new URL(shareLink('http://host/', recording, display, null, null)).search).toBe(`?recording=${recording.name}`);
  });

  it('says the time of day where a person went back in a live stream', () => {
    const playback = { times: Float64Array.of(0, 500), position: 500, startMs: 1_795_338_300_000, playing: true } as unknown as Playback;
    expect(momentOf({ ...playback, following: true })).toBe('live');
    expect(momentOf({ ...playback, following: false })).toEqual({ atMs: 1_795_338_300_500, utc: true, playing: true });
    expect(momentOf({ ...playback, following: null })).toEqual({ atMs: 500, utc: false, playing: true });
    expect(momentOf({ ...playback, times: new Float64Array(), following: null })).toBeNull();
  });

  it.each(['', 'time=', 'time=live', 'time=-1', 'time=1e9', 'time=NaN', 'time=2026-13-45T00:00:00Z', 'time=12345678'])(
    'without a time that makes sense has none: %s',
    (hash) => expect(readShared(hash, kDefaultDisplay).moment).toBeNull(),
  );

  it.each(['', '#', '#eye=1_2&at=0_0_0', '#eye=1_2_x&at=0_0_0', '#eye=1__2&at=0_0_0', '#eye=1_1_1&at=1_1_1', '#eye=1e99_0_0&at=0_0_0', '#eye=0_0_1'])(
    'without a whole view shows the first one: %s',
    (hash) => expect(readShared(hash, kDefaultDisplay)).toEqual({ display: kDefaultDisplay, pose: null, moment: null, places: new Map(), measured: nothing }),
  );

  it('brings back what was measured as it was written, the last of very many', () => {
    const measured = { measurements: ['point_x_x__0_surface_0_0_1_x', 'distance_x_x'], flatness: 'plane_1_2_3_4' };
    const back = (of: Measured): Measured =>
      readShared(new URL(shareLink('http://host/', recording, display, null, null, undefined, of)).hash, kDefaultDisplay).measured;
    expect(back(measured)).toEqual(measured);
    expect(back(nothing)).toEqual(nothing);
    const many = Array.from({ length: 100 }, (_, i) => `point_${i}`);
    expect(back({ measurements: many, flatness: null }).measurements).toEqual(many.slice(-64));
    expect(readShared(`#${many.map((m) => `measure=${m}`).join('&')}`, kDefaultDisplay).measured.measurements).toHaveLength(64);
  });

  it('is of streams, or of a recording', () => {
    expect(namesOf('?stream=face,left_one&quality=full')).toEqual(['face', 'left_one']);
    expect(namesOf('?recording=a%2Cb.mcap')).toEqual(['a,b.mcap']);
    for (const search of ['', '?stream=', '?x=1']) expect(namesOf(search)).toEqual([]);
  });
});

describe('PLY', () => {
  it('is read by others', () => {
    const loader = new PLYLoader();
    loader.setCustomPropertyNameMapping({ sigma: ['sigma'], interpolated: ['interpolated'] });
    const read = loader.parse(writePly(surface, picture).buffer);
    expect([...read.getAttribute('position').array]).toEqual([...surface.positions]);
    expect([...read.getIndex()!.array]).toEqual([0, 1, 2]);
    expect([...read.getAttribute('color').array].map(Math.round)).toEqual([1, 0, 0, 0, 0, 1, 0, 0, 1]);
    expect([...read.getAttribute('sigma').array]).toEqual([...surface.quality!.sigmas]);
    expect([...read.getAttribute('interpolated').array]).toEqual([0, 1, 0]);
  });
});

describe('a surface with a colour a vertex, as of a file of this device', () => {
  const linear = [1, 0, 0, 0.2140, 0.2140, 0.2140, 0, 0.5, 0.001];
  const coloured: Surface = { ...surface, coordinates: null, colours: new Float32Array(linear) };

  it('keeps them as PLY', () => {
    const read = new PLYLoader().parse(writePly(coloured, null).buffer);
    for (const [i, c] of read.getAttribute('color').array.entries()) expect(c).toBeCloseTo(linear[i]!, 2);
  });

  it('keeps them as GLB', async () => {
    const { scene } = await new GLTFLoader().parseAsync(writeGlb(coloured, null).buffer, '');
    const { geometry, material } = scene.children[0] as Mesh<BufferGeometry, MeshBasicMaterial>;
    expect([...geometry.getAttribute('color').array]).toEqual([...coloured.colours!]);
    expect(material.color.toArray()).toEqual([1, 1, 1]); // they are not dimmed
  });
});

describe('GLB', () => {
  it('without a surface, as where nobody is seen, is a scene with nothing in it', async () => {
    const nothing = { positions: new Float32Array(), coordinates: new Float32Array(), triangles: new Uint32Array(), quality: null };
    const bytes = writeGlb(nothing, new Uint8Array([1, 2, 3]));
    const json = JSON.parse(new TextDecoder().decode(bytes.subarray(20, 20 + new DataView(bytes.buffer).getUint32(12, true))));
    expect([json.accessors, json.bufferViews, json.buffers]).toEqual([undefined, undefined, undefined]); // glTF allows none of zero length
    expect(new DataView(bytes.buffer).getUint32(8, true)).toBe(bytes.length);
    expect((await new GLTFLoader().parseAsync(bytes.buffer, '')).scene.children).toEqual([]);
  });

  it('is laid out as glTF says', () => {
    const jpeg = new Uint8Array([1, 2, 3, 4, 5]);
    const bytes = writeGlb(surface, jpeg);
    const view = new DataView(bytes.buffer);
    expect([view.getUint32(0, true), view.getUint32(4, true), view.getUint32(8, true)]).toEqual([0x46546c67, 2, bytes.length]);
    const jsonBytes = view.getUint32(12, true);
    const json = JSON.parse(new TextDecoder().decode(bytes.subarray(20, 20 + jsonBytes)));
    const bin = bytes.subarray(28 + jsonBytes);
    expect(json.buffers[0].byteLength).toBe(bin.length);
    for (const { byteOffset } of json.bufferViews) expect(byteOffset % 4).toBe(0);
    const floats = (accessor: number): number[] => {
      const { byteOffset, byteLength } = json.bufferViews[json.accessors[accessor].bufferView];
      return [...new Float32Array(bin.slice(byteOffset, byteOffset + byteLength).buffer)];
    };
    const { attributes } = json.meshes[0].primitives[0];
    expect(floats(attributes.POSITION).map((c) => c + 0)).toEqual([0, 0, -1, 0.5, 0, -1, 0.5, -0.5, -2]);
    expect(json.accessors[attributes.POSITION]).toMatchObject({ min: [0, -0.5, -2], max: [0.5, 0, -1] });
    expect(floats(attributes.TEXCOORD_0)).toEqual([...surface.coordinates!]);
    const image = json.bufferViews[json.images[0].bufferView];
    expect([...bin.subarray(image.byteOffset, image.byteOffset + image.byteLength)]).toEqual([...jpeg]);
  });
});
