// SPDX-License-Identifier: Apache-2.0
// How many frames may be under way from a server. Two keep the page busy: one is decoded while the next travels. A
// page that takes far longer to draw a frame than one takes to come shows an older one for it: what it has decoded
// waited for a whole drawing. There, each is asked for when the one before is shown. Where the server is far, two would
// come in each round trip, however quick the page and the line: as many more are under way as a round trip holds.

const kSlow_ms = 80; // between frames: longer is a page that does not follow
const kQuick_ms = 50;
const kComesLate = 0.5; // of the time between frames, until one that was asked for comes: the way is what takes long
const kInARow = 5; // frames that say so
const kMost = 7; // a server holds credit for 8, and a page that rests has one more
const kWeight = 0.3; // of the newest time in the mean

export class Credit {
  frameRate = 0; // of the stream; 0: not known
  private follows = true;
  private roundTrip_ms: number | null = null; // the shortest, but for the first: the page is busy with its beginning then
  private isFirst = true;
  private shownAt = 0;
  private skips = false; // since one was shown
  private askedAt: number | null = null; // while one is waited for
  private comesIn_ms = 0;
  private inARow = 0;

  get frames(): number {
    const far = Math.floor(((this.roundTrip_ms ?? 0) * this.frameRate) / 1000);
    return this.follows ? Math.min(kMost, 2 + far) : 1;
  }

  /** A connection, perhaps by another way than before. */
  opened(): void {
    this.isFirst = true;
    this.roundTrip_ms = null;
  }

  /** A word to the server and back took so long. */
  wentRound(ms: number): void {
    if (!this.isFirst) this.roundTrip_ms = Math.min(this.roundTrip_ms ?? ms, ms);
    this.isFirst = false;
  }

  /** Frames were asked for, where none was under way. */
  asked(now: number): void {
    this.askedAt ??= now;
  }

  /** One came. */
  came(now: number): void {
    if (this.askedAt === null) return;
    this.comesIn_ms += kWeight * (now - this.askedAt - this.comesIn_ms);
    this.askedAt = null;
  }

  /** One was not shown, since a newer one was there already. */
  skipped(): void {
    this.skips = true;
  }

  /** One was shown, while so many others had come already. */
  shown(now: number, waiting: number): void {
    const every_ms = now - this.shownAt;
    this.shownAt = now;
    const slow = every_ms > kSlow_ms && (waiting > 0 || this.skips);
    this.skips = false;
    const quick = every_ms < kQuick_ms || this.comesIn_ms > kComesLate * every_ms;
    this.inARow = (this.follows ? slow : quick) ? this.inARow + 1 : 0;
    if (this.inARow < kInARow) return;
    this.inARow = 0;
    this.follows = !this.follows;
  }
}
