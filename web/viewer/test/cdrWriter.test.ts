// SPDX-License-Identifier: Apache-2.0
// Proves: what is written as CDR is what the reader of recordings reads.
import { describe, expect, it } from 'vitest';
import { readFrameHead, readStreamInfo } from '../src/cdr';
import { writeFrame, writeStreamInfo } from '../src/cdrWriter';
import { kInfo } from './streamInfo';

describe('a frame', () => {
  it.each(['a', 'face', 'a-longer.name'])('of stream %s', (stream) => {
    const data = Uint8Array.from([0x52, 0x4c, 0x56, 0x46, 1, 1, 9, 9, 9]);
    const captureNs = 1_700_000_000_123_456_789n;
    const sample = writeFrame({ stream, sequence: 7n, number: 9n, captureNs, publishNs: captureNs + 5_000_000n, data });
    expect(sample.length % 4).toBe(0);
    const head = readFrameHead(sample);
    expect(head).toMatchObject({ stream, sequence: 7, number: 9, isKey: true, length: data.length });
    expect(head.captureMs).toBeCloseTo(1_700_000_000_123.456, 2);
    expect(sample.subarray(head.at, head.at + head.length)).toEqual(data);
  });
});

describe('a description', () => {
  it('is read back', () => {
    const { started_ns: _started, field_order: _order, colour_matrix: _colour, pattern: _pattern, ...kept } = kInfo;
    expect(readStreamInfo(writeStreamInfo(kInfo)!)).toEqual(kept);
  });
  it('of a server that did not say how good its rig is', () => {
    const { stereo_rms_px: _rms, scale_error: _scale, world_from_camera_rotation: _r, world_from_camera_translation: _t, ...older } = kInfo;
    expect(readStreamInfo(writeStreamInfo(older)!)).toMatchObject({ stereo_rms_px: 0, scale_error: 0 });
    expect(readStreamInfo(writeStreamInfo(older)!)).not.toHaveProperty('world_from_camera_rotation');
  });
  it('of a server that did not say its camera\'s gamma', () => {
    const whole = writeStreamInfo(kInfo)!;
    const gamma = new Uint8Array(new Float64Array([kInfo.camera_gamma!]).buffer);
    const at = whole.findIndex((_, i) => gamma.every((byte, k) => whole[i + k] === byte));
    const older = Uint8Array.from([...whole.subarray(0, at), ...whole.subarray(at + 8)]);
    const lengths = new DataView(older.buffer);
    const kRigAt = 44; // behind the header, the names and the time of the start
    expect(kRigAt + 4 + lengths.getUint32(kRigAt, true)).toBe(at + 8);
    for (const length of [4, kRigAt]) lengths.setUint32(length, lengths.getUint32(length, true) - 8, true);
    const { camera_gamma: _, ...rest } = readStreamInfo(whole);
    expect(readStreamInfo(older)).toEqual({ ...rest, camera_gamma: 1 });
    expect(readStreamInfo(writeStreamInfo({ ...kInfo, camera_gamma: 0 })!).camera_gamma).toBe(1);
  });
  it('of stripes that are not all there is none', () => {
    const whole = writeStreamInfo(kInfo)!;
    expect(() => readStreamInfo(whole.subarray(0, whole.length - 8))).toThrow(/ends too early/);
  });
  it('is none where the server did not say enough', () => {
    const { pattern: _, ...older } = kInfo;
    expect(writeStreamInfo(older)).toBeNull();
  });
});
