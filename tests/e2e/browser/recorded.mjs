// SPDX-License-Identifier: Apache-2.0
// A recording of the simulated rig without a gap, however slow or loaded the machine.
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { rmSync } from 'node:fs';

/** Records `frames` surfaces of a simulated scene into `file`, `rate` of them a second or, on a slow machine, fewer; returns `file`. `options`: more of serve. */
export function recordObject(serverPath, file, { rate, frames, scene = 'object', size = 'width=320,height=240,stripes=60', options = [] }) {
  const domain = process.env.RELIEVO_TEST_DOMAIN;
  assert.ok(domain, 'RELIEVO_TEST_DOMAIN is not set: run this through in_own_domain');
  // The first surface takes two frames of the camera.
  const args = ['serve', '--frames', String(frames + 1), '--web', 'none', '--record', file, '--domain', domain, '--interface', 'lo'];
  let said;
  // A server that keeps a rig's pace drops what it is too slow for, which may be once. --fast would drop nothing, but make
  // recordings of less than a second.
  for (const pace of [rate, rate, rate / 2, rate / 4]) {
    rmSync(file, { force: true });
    const source = `sim:${scene},${size},rate=${Math.max(pace, 1)}`;
    const { status, stderr } = spawnSync(serverPath, [...args, '--source', source, ...options], { encoding: 'utf8' });
    assert.equal(status, 0, stderr);
    if (stderr.includes(`recorded ${frames} frames, 0 lost`)) return file;
    said = stderr;
  }
  throw new Error(`frames were dropped at any pace: ${said}`);
}
