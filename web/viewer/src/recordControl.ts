// SPDX-License-Identifier: Apache-2.0
// The record button: the server records into its folder where it has one, else this page saves what it keeps of the
// stream and what follows as a file of this device.
import { element, setText } from './dom';
import { download } from './download';
import { clockText } from './playback';
import type { ServerRecording, StreamInfo } from './protocol';
import type { DescribedSample } from './recordingFile';
import type { LiveSource } from './liveSource';
import { text } from './strings';
import { askBeforeLeaving, mayLeave } from './unsaved';

const say = text.record;
const kEveryMs = 1000; // between questions to a server that records
const kSaidMs = 10_000; // how long it is said where a recording went
const kMostBytes = 1e9; // kept here, in memory
const kPatienceMs = 5000; // with a server that was asked
const kCoarse_ms = 1500; // a server says its time in whole seconds

const loadWriters = () => Promise.all([import('./recordingFile'), import('./sample'), import('./cdrWriter')]);

/** What runs in this page. */
export interface Running {
  bytes: number;
  readonly since: number; // performance.now()
}

interface Taken extends Running {
  frames: { message: ArrayBuffer; info: StreamInfo | null }[];
  info: StreamInfo | null; // the last that there was
}

interface Answer {
  readonly status: number;
  readonly told: ServerRecording | null; // null: an error, which `why` says
  readonly why: string;
  readonly now: number | undefined; // by the server's clock, UTC in ms
}

export interface Recorded {
  stream: string;
  source: LiveSource;
  info(): StreamInfo | null;
}

export class RecordControl {
  private readonly pill = element('recording');
  private of: Recorded | null = null;
  private server: ServerRecording | null = null; // null: it has no folder, or was not asked yet
  private heardAt = 0; // when the server said so, performance.now()
  private startedAt = 0; // when it began to, by the same clock
  private isUnheard = false; // it did not answer since
  private taken: Taken | null = null; // by this page
  private video: Running | null = null;
  private serverHasNone = false; // no folder: known once it was asked
  private asking = false;
  private timer = 0;
  private saidUntil = 0;

  constructor(private readonly button: HTMLButtonElement) {
    button.onclick = () => this.toggle();
    window.setInterval(() => this.show(), kEveryMs / 2);
    this.show();
  }

  /** The live stream that can be recorded from now on; null: none. What was being saved here is saved. */
  watch(of: Recorded | null): void {
    if (this.taken !== null) void this.save();
    window.clearTimeout(this.timer);
    this.of = of;
    this.server = null;
    this.isUnheard = this.serverHasNone = false;
    this.show();
  }

  /** A video of the view that runs; null: none. */
  filming(video: Running | null): void {
    this.video = video;
    this.show();
  }

  /** What the list of streams says of this one's: others start and stop it too. */
  listed(stream: string, told: ServerRecording | null | undefined): void {
    if (this.of?.stream !== stream || this.asking || this.taken !== null || told === undefined) return;
    this.serverHasNone = told === null;
    // What this page follows itself it knows better.
    if (told !== null && told.state === 'recording' && this.server?.state !== 'recording') this.take(told);
    this.show();
  }

  toggle(): void {
    if (this.of === null || this.asking) return;
    if (this.taken !== null) void this.save();
    else if (this.serverHasNone) this.start();
    else void this.order(this.server?.state === 'recording' ? 'stop' : 'start');
  }

  private get isRecording(): boolean {
    return this.taken !== null || this.server?.state === 'recording';
  }

  private async order(action: 'start' | 'stop'): Promise<void> {
    this.asking = true;
    const { of } = this;
    const answer = await this.ask({
      method: 'POST',
      body: JSON.stringify({ action }),
      headers: { 'content-type': 'application/json' },
    });
    this.asking = false;
    if (this.of !== of) return;
    const isStart = action === 'start';
    if (isStart && (answer?.status === 404 || answer?.status === 405)) {
      this.serverHasNone = true; // also a server that knows no such thing
      this.start();
    } else if (answer?.status === 409) {
      void this.follow(); // somebody else was quicker
    } else if (answer?.told != null) {
      this.take(answer.told, answer.now);
    } else {
      const why = answer?.why ?? say.unreachable;
      this.say(isStart ? say.failed(why) : say.notStopped(why), true);
    }
  }

  /** What the server's recording does meanwhile. */
  private async follow(): Promise<void> {
    const { of } = this;
    const answer = await this.ask({});
    if (this.of !== of) return;
    if (answer?.told != null) this.take(answer.told, answer.now);
    else this.miss();
  }

  /** Null: no answer came, or not all of one. */
  private async ask(init: RequestInit): Promise<Answer | null> {
    const url = new URL(`api/recording/${encodeURIComponent(this.of!.stream)}`, document.baseURI);
    try {
      const response = await fetch(url, { cache: 'no-store', signal: AbortSignal.timeout(kPatienceMs), ...init });
      const { ok, status } = response;
      const text = await response.text();
      return { status, told: ok ? (JSON.parse(text) as ServerRecording) : null, why: text.trim(), now: dateOf(response) };
    } catch {
      return null;
    }
  }

  /** `now`: by the server's clock, UTC in ms; this page's may be another. */
  private take(told: ServerRecording, now = Date.now()): void {
    const before = this.server;
    this.server = told;
    this.heardAt = performance.now();
    const startedAt = this.heardAt - Math.max(0, now - told.started_ns / 1e6);
    if (told.file !== before?.file || Math.abs(startedAt - this.startedAt) > kCoarse_ms) this.startedAt = startedAt;
    this.isUnheard = false;
    if (told.state === 'failed') this.say(say.failed(told.message), true);
    if (told.state === 'off' && before?.state === 'recording') this.say(say.savedThere(told.file || before.file, told.frames || before.frames));
    if (told.state === 'recording') this.again();
    if (told.state === 'recording' && before?.state !== 'recording') this.saidUntil = 0;
    this.show();
  }

  /** It may come back. */
  private miss(): void {
    this.isUnheard = true;
    this.again();
    this.show();
  }

  private again(): void {
    window.clearTimeout(this.timer);
    this.timer = window.setTimeout(() => void this.follow(), kEveryMs);
  }

  private start(): void {
    const { source, info } = this.of!;
    const taken: Taken = { frames: [], info: info(), bytes: 0, since: performance.now() };
    const take = (message: ArrayBuffer): void => {
      taken.info = info() ?? taken.info;
      taken.frames.push({ message, info: taken.info });
      taken.bytes += message.byteLength;
    };
    source.keptMessages().forEach(take);
    this.taken = taken;
    loadWriters().catch(() => undefined); // now that the server is there: that it has gone may be why it is saved
    this.saidUntil = 0;
    askBeforeLeaving(taken);
    source.tap = (message) => {
      take(message);
      if (taken.bytes > kMostBytes) void this.save();
    };
    this.show();
  }

  private async save(): Promise<void> {
    const { of, taken } = this;
    this.taken = null;
    of!.source.tap = null;
    try {
      const { frames } = taken!;
      if (frames.length === 0) return this.say(say.nothing, true);
      const [{ writeRecording }, { sampleOf }, { writeStreamInfo }] = await loadWriters();
      const described = new Map<StreamInfo | null, Uint8Array | null>([[null, null]]);
      function* samples(): Generator<DescribedSample> {
        for (const { message, info } of frames) {
          if (!described.has(info)) described.set(info, writeStreamInfo(info!));
          yield { sample: sampleOf(of!.stream, message), description: described.get(info)! };
        }
      }
      const content = await writeRecording(of!.stream, samples());
      const name = `${of!.stream}-${new Date().toISOString().slice(0, 19).replace(/[-:]/g, '').replace('T', '-')}.mcap`;
      download(name, content);
      this.say(say.savedHere(name, frames.length, content.size));
    } catch (error) {
      this.say(say.failed(error instanceof Error ? error.message : String(error)), true);
    } finally {
      mayLeave(taken!);
    }
  }

  private say(what: string, bad = false): void {
    this.saidUntil = performance.now() + kSaidMs;
    this.pill.className = bad ? 'bad' : '';
    setText(this.pill, what);
    this.pill.title = what; // where there is no room for all of it
    this.show();
  }

  private show(): void {
    const { isRecording } = this;
    const isUnknown = this.taken === null && this.isUnheard;
    this.button.hidden = this.of === null;
    this.button.setAttribute('aria-pressed', isRecording && isUnknown ? 'mixed' : String(isRecording));
    const title = isRecording ? say.stop : this.serverHasNone ? say.startHere : say.start;
    this.button.title = title;
    this.button.setAttribute('aria-label', title);
    const isSaid = performance.now() < this.saidUntil;
    this.pill.hidden = !isSaid && !isRecording && this.video === null;
    if (isSaid || this.pill.hidden) return;
    this.pill.className = isRecording && isUnknown ? 'unknown' : 'on';
    const words = [isRecording ? this.recordingWords() : null, this.video === null ? null : say.video(runningWords(this.video))];
    this.pill.title = words.filter((w) => w !== null).join(' · ');
    setText(this.pill, this.pill.title);
  }

  private recordingWords(): string {
    if (this.taken !== null) return runningWords(this.taken);
    const words = say.running(timeText((this.isUnheard ? this.heardAt : performance.now()) - this.startedAt), this.server!.bytes);
    return this.isUnheard ? say.unknown(words) : words;
  }
}

function dateOf({ headers }: Response): number | undefined {
  const utc = Date.parse(headers.get('date') ?? '');
  return Number.isNaN(utc) ? undefined : utc;
}

const timeText = (ms: number): string => clockText(ms).replace(/\.\d+$/, '');
const runningWords = ({ since, bytes }: Running): string => say.running(timeText(performance.now() - since), bytes);
