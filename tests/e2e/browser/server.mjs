// SPDX-License-Identifier: Apache-2.0
// `relievo-server serve` with its viewer, in a DDS domain of its own.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { createInterface } from 'node:readline';

// Those that a test which fails has not come to end must not outlive it: an exception ends the process at once.
const running = new Set();
process.on('exit', () => {
  for (const server of running) server.kill('SIGKILL');
});

export class Server {
  /** `options`: of serve, beside those for the network; `environment`: beside this process's own. */
  static start(path, options, environment = {}) {
    return Server.run(path, ['serve', ...options, '--web', '127.0.0.1:0'], environment);
  }

  /** `relievo web` of files and streams. */
  static startWeb(path, inputs) {
    return Server.run(path, ['web', ...inputs, '--listen', '127.0.0.1:0'], {});
  }

  static async run(path, options, environment) {
    const domain = process.env.RELIEVO_TEST_DOMAIN;
    assert.ok(domain, 'RELIEVO_TEST_DOMAIN is not set: run this through in_own_domain');
    const server = new Server();
    server.process = spawn(path, [...options, '--domain', domain, '--interface', 'lo'], {
      stdio: ['ignore', 'pipe', 'pipe'],
      env: { ...process.env, ...environment },
    });
    running.add(server.process);
    server.process.once('exit', () => running.delete(server.process));
    server.said = ''; // its log
    server.process.stderr.on('data', (text) => {
      server.said += text;
      process.stderr.write(text);
    });
    server.exited = new Promise((resolve) => server.process.once('exit', (code, signal) => resolve({ code, signal })));
    const address = await new Promise((resolve, reject) => {
      createInterface({ input: server.process.stdout }).on('line', (line) => {
        if (line.startsWith('viewer ')) resolve(line.slice('viewer '.length));
      });
      server.exited.then(({ code }) => reject(new Error(`the server ended with status ${code} before it served`)));
    });
    server.address = new URL(address).origin;
    return server;
  }

  /** All that were started and are not at their end. */
  static async killAll() {
    const exits = [...running].map((server) => new Promise((resolve) => server.once('exit', resolve)));
    for (const server of running) server.kill('SIGKILL');
    await Promise.all(exits);
  }

  async kill() {
    this.process.kill('SIGKILL');
    await this.exited;
  }
}
