// SPDX-License-Identifier: Apache-2.0
// A recording as a source of frames.
import type { Recording } from './recording';
import type { FrameSource, Playback, SourceEvents } from './source';
import { StorePlayer } from './storePlayer';

export class RecordingSource extends StorePlayer implements FrameSource {
  readonly connected = true;
  readonly retryInS = null;
  readonly live = false;
  readonly kept = null;
  readonly playback: Playback = this;

  constructor(recording: Recording, events: SourceEvents) {
    super(recording, events);
    // Not before the caller holds the source.
    queueMicrotask(() => {
      if (this.stopped) return;
      events.open();
      if (recording.info !== null) events.message({ type: 'info', ...recording.info });
      this.play();
    });
    void recording.readHeads(() => {
      this.changed();
      return !this.stopped;
    });
  }

  retryNow(): void {}
}
