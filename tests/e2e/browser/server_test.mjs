// SPDX-License-Identifier: Apache-2.0
// Proves: the server of a browser test that fails ends with it.
// Run as: in_own_domain node server_test.mjs RELIEVO_SERVER, in web/viewer. Exit 77: no Chromium here.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { fileURLToPath } from 'node:url';
import { eventually } from './chromium.mjs';
import { Server } from './server.mjs';

const [serverPath, part] = process.argv.slice(2);
if (part === 'fails') {
  const server = await Server.start(serverPath, ['--source', 'sim:object,width=160,height=120', '--stream', 'left']);
  console.log(`${server.process.pid} ${server.address}`);
  throw new Error('as a check that fails');
}
const test = spawn(process.execPath, [fileURLToPath(import.meta.url), serverPath, 'fails'], { stdio: ['ignore', 'pipe', 'ignore'] });
let said = '';
test.stdout.on('data', (text) => (said += text));
assert.equal(await new Promise((resolve) => test.once('exit', resolve)), 1);
const [, pid, address] = /^(\d+) (http:.*)/.exec(said);
try {
  await eventually('the server is left behind', () => fetch(`${address}/healthz`).then(() => false, () => true));
} catch (error) {
  process.kill(Number(pid), 'SIGKILL');
  throw error;
}
