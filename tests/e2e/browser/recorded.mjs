// SPDX-License-Identifier: Apache-2.0
// A recording of the simulated rig without a gap, however slow or loaded the machine.
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { rmSync } from 'node:fs';

/** Records `frames` surfaces of a simulated scene into `file`, about `rate` of them a second; returns `file`. `options`: more of serve. */
export function recordObject(serverPath, file, { rate, frames, scene = 'object', size = 'width=320,height=240,stripes=60', options = [] }) {
  const domain = process.env.RELIEVO_TEST_DOMAIN;
  assert.ok(domain, 'RELIEVO_TEST_DOMAIN is not set: run this through in_own_domain');
  const source = `sim:${scene},${size},rate=${rate}`;
  // The first surface takes two frames of the camera.
  const args = ['serve', '--source', source, '--frames', String(frames + 1), '--web', 'none', '--record', file, '--domain', domain, '--interface', 'lo'];
  let said;
  // A server that keeps a rig's pace drops what it is too slow for, which may be once. Else it takes the time that it
  // needs, and where that is little the recording is a short one.
  for (const pace of [[], [], [], ['--fast']]) {
    rmSync(file, { force: true });
    const { status, stderr } = spawnSync(serverPath, [...args, ...options, ...pace], { encoding: 'utf8' });
    assert.equal(status, 0, stderr);
    if (stderr.includes(`recorded ${frames} frames, 0 lost`)) return file;
    said = stderr;
  }
  throw new Error(`frames were dropped at any pace: ${said}`);
}
