// SPDX-License-Identifier: Apache-2.0
// A recording as a source of frames.
import type { Recording } from './recording';
import type { FrameSource, Moment, Playback, SourceEvents } from './source';
import { StorePlayer } from './storePlayer';

export class RecordingSource extends StorePlayer implements FrameSource {
  readonly connected = true;
  readonly retryInS = null;
  readonly live = false;
  readonly kept = null;
  readonly playback: Playback = this;

  /** Plays from its start, or is at `begin`; times that it does not have mean nothing. */
  constructor(recording: Recording, events: SourceEvents, begin: Moment | null = null) {
    super(recording, events);
    // Not before the caller holds the source.
    queueMicrotask(() => {
      if (this.stopped) return;
      events.open();
      if (recording.info !== null) events.message({ type: 'info', ...recording.info });
      const at = begin === null ? -1 : begin.atMs - (begin.utc ? this.startMs : 0);
      const { times } = this;
      const has = at >= times[0]! && at < times[times.length - 1]! + 1; // links are of whole milliseconds
      if (has) this.seek(at);
      if (!has || begin!.playing) this.play();
    });
    void recording.readHeads(() => {
      this.changed();
      return !this.stopped;
    });
  }

  retryNow(): void {}
}
