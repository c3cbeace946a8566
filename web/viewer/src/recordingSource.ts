// SPDX-License-Identifier: Apache-2.0
// A recording as a source of frames. One of the server that is still being written grows, and who is at its end goes
// on with what comes.
import { Unavailable } from './missing';
import type { FramePrefix, StreamInfo, Written } from './protocol';
import type { Recording } from './recording';
import type { FrameSource, Moment, Playback, SourceEvents } from './source';
import { StorePlayer } from './storePlayer';

export class RecordingSource extends StorePlayer implements FrameSource {
  readonly connected = true;
  readonly retryInS = null;
  readonly live = false;
  readonly kept = null;
  readonly playback: Playback = this;
  private isWritten = false; // by the server, as far as it has said
  private settled = false; // was read when that was over
  private refused = false;
  private asking = false;
  private marking = false;
  private described: StreamInfo | null = null; // what was said last
  private atEnd = false; // played to it, and nobody did anything since

  /** Plays from its start, or is at `begin`; times that it does not have mean nothing. */
  constructor(
    private readonly recording: Recording,
    private readonly events: SourceEvents,
    begin: Moment | null = null,
  ) {
    super(recording, events);
    // Not before the caller holds the source.
    queueMicrotask(() => void this.begin(begin));
    void this.mark();
  }

  private async begin(moment: Moment | null): Promise<void> {
    if (this.stopped) return;
    this.events.open();
    this.describe(-Infinity);
    const at = moment?.utc === true ? await this.recording.timeOf(moment.atMs).catch(() => null) : (moment?.atMs ?? null);
    if (this.stopped) return;
    const { times } = this;
    const has = at !== null && at >= times[0]! && at < times[times.length - 1]! + 1; // links are of whole milliseconds
    if (has) this.seek(at);
    if (!has || moment!.playing) this.play();
  }

  /** At the end of what is still being written, too, where it goes on by itself. */
  override get playing(): boolean {
    return super.playing || this.awaits;
  }

  override play(): void {
    this.atEnd = false;
    super.play();
  }

  override pause(): void {
    this.atEnd = false;
    super.pause();
  }

  override seek(atMs: number): void {
    const goesOn = this.isWritten && this.playing;
    this.atEnd = false;
    super.seek(atMs);
    if (!goesOn || super.playing) return;
    if (this.position < this.endMs) super.play();
    else this.atEnd = true; // else it would begin again
  }

  async told(recorder: Written | undefined): Promise<void> {
    const { end } = this.recording;
    if (end === null || this.asking || this.refused) return;
    // One that was stopped says so until it is whole.
    const isWritten = recorder?.state === 'recording' || (recorder?.state === 'off' && recorder.message !== '');
    const more = isWritten ? (recorder.whole_bytes ?? 0) > end : !this.settled;
    if (isWritten) {
      this.settled = false;
      this.write(true);
    }
    if (!more) return;
    this.asking = true;
    try {
      const grew = await this.recording.grow();
      if (this.stopped) return;
      if (grew) this.grew();
      this.settled = !isWritten;
    } catch (error) {
      if (!(error instanceof Unavailable)) {
        this.refused = true;
        if (!this.stopped) this.events.nonsense(error instanceof Error ? error.message : String(error));
      }
    } finally {
      this.asking = false;
    }
    if (!isWritten || this.refused) this.write(false);
  }

  retryNow(): void {}

  protected override handing({ publishMs }: FramePrefix): void {
    this.describe(publishMs);
  }

  // Each time that it is another one than before: the server was started again meanwhile, perhaps with another rig.
  private describe(publishMs: number): void {
    const info = this.recording.infoAt(publishMs);
    if (info === null || info === this.described) return;
    this.described = info;
    this.events.message({ type: 'info', ...info });
  }

  protected override ended(): void {
    this.atEnd = true;
    this.goOn(); // it may have grown just now
  }

  private get awaits(): boolean {
    return this.atEnd && this.isWritten;
  }

  private get endMs(): number {
    return this.times[this.times.length - 1]!;
  }

  private write(isWritten: boolean): void {
    if (isWritten === this.isWritten) return;
    this.isWritten = isWritten;
    this.changed();
  }

  private grew(): void {
    this.goOn();
    this.changed();
    void this.mark();
  }

  private goOn(): void {
    if (this.atEnd && this.position < this.endMs) this.play();
  }

  // What decodes alone, and gaps.
  private async mark(): Promise<void> {
    if (this.marking) return;
    this.marking = true;
    await this.recording.readHeads(() => {
      this.changed();
      return !this.stopped;
    });
    this.marking = false;
  }
}
