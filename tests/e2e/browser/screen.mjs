// SPDX-License-Identifier: Apache-2.0
// The projector of the browser tests.
import { spawn } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';

/** An X server without a screen, whose frame buffer can be read. */
export class Screen {
  static async start(width, height) {
    const screen = new Screen();
    screen.folder = mkdtempSync(join(tmpdir(), 'relievo-screen-'));
    const options = ['-displayfd', '3', '-screen', '0', `${width}x${height}x24`, '-fbdir', screen.folder, '-nolisten', 'tcp'];
    screen.process = spawn('Xvfb', options, { stdio: ['ignore', 'ignore', 'ignore', 'pipe'] });
    screen.ended = new Promise((resolve) => screen.process.once('exit', resolve));
    const number = await new Promise((resolve, reject) => {
      screen.process.stdio[3].once('data', resolve);
      screen.process.once('error', reject);
      screen.process.once('exit', () => reject(new Error('Xvfb did not start: apt-get install xvfb')));
    });
    screen.environment = { DISPLAY: `:${String(number).trim()}`, LIBGL_ALWAYS_SOFTWARE: '1' };
    return screen;
  }
  /** Shares of pixels that are white, and that are of a saturated colour. */
  seen() {
    const data = readFileSync(join(this.folder, 'Xvfb_screen0')); // an XWD file
    const head = (i) => data.readUInt32BE(4 * i);
    const [size, width, height, stride, colours] = [head(0), head(4), head(5), head(12), head(19)];
    const start = size + 12 * colours;
    const out = { white: 0, coloured: 0 };
    for (let y = 0; y < height; ++y) {
      for (let x = 0; x < width; ++x) {
        const at = start + y * stride + 4 * x;
        const rgb = [data[at], data[at + 1], data[at + 2]];
        const [least, most] = [Math.min(...rgb), Math.max(...rgb)];
        out.white += least > 250 ? 1 : 0;
        out.coloured += most > 250 && least < 5 ? 1 : 0;
      }
    }
    return { white: out.white / (width * height), coloured: out.coloured / (width * height) };
  }
  async close() {
    this.process.kill('SIGTERM');
    await this.ended;
    rmSync(this.folder, { recursive: true, force: true });
  }
}
