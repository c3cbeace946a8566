// SPDX-License-Identifier: Apache-2.0
// The record button: the server records into its folder where it has one, else this page saves what it keeps of the
// stream and what follows as a file of this device.
import { element, setText } from './dom';
import { download } from './download';
import { clockText } from './playback';
import type { ServerRecording, StreamInfo } from './protocol';
import type { LiveSource } from './liveSource';
import { text } from './strings';

const say = text.record;
const kEveryMs = 1000; // between questions to a server that records
const kSaidMs = 10_000; // how long it is said where a recording went
const kMostBytes = 1e9; // kept here, in memory

interface Taken {
  messages: ArrayBuffer[];
  bytes: number;
  since: number; // performance.now()
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
  private taken: Taken | null = null; // by this page
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
    this.serverHasNone = false;
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
    const response = await this.ask({
      method: 'POST',
      body: JSON.stringify({ action }),
      headers: { 'content-type': 'application/json' },
    });
    const why = response === null ? say.unreachable : response.ok ? null : (await response.text()).trim();
    this.asking = false;
    if (this.of !== of) return;
    if (response?.status === 404 || response?.status === 405) {
      this.serverHasNone = true; // also a server that knows no such thing
      this.start();
    } else if (response?.status === 409) {
      void this.follow(); // somebody else was quicker
    } else if (why !== null) {
      this.say(say.failed(why), true);
    } else {
      this.take((await response!.json()) as ServerRecording);
    }
  }

  /** What the server's recording does meanwhile. */
  private async follow(): Promise<void> {
    const { of } = this;
    const response = await this.ask({});
    if (this.of !== of) return;
    if (response?.ok === true) this.take((await response.json()) as ServerRecording);
    else this.again(); // it may come back
  }

  private ask(init: RequestInit): Promise<Response | null> {
    const url = new URL(`api/recording/${encodeURIComponent(this.of!.stream)}`, document.baseURI);
    return fetch(url, { cache: 'no-store', ...init }).catch(() => null);
  }

  private take(told: ServerRecording): void {
    const before = this.server;
    this.server = told;
    if (told.state === 'failed') this.say(say.failed(told.message), true);
    if (told.state === 'off' && before?.state === 'recording') this.say(say.savedThere(told.file || before.file, told.frames || before.frames));
    if (told.state === 'recording') this.again();
    this.show();
  }

  private again(): void {
    window.clearTimeout(this.timer);
    this.timer = window.setTimeout(() => void this.follow(), kEveryMs);
  }

  private start(): void {
    const { source } = this.of!;
    const messages = source.keptMessages();
    const taken = { messages, bytes: messages.reduce((sum, m) => sum + m.byteLength, 0), since: performance.now() };
    this.taken = taken;
    source.tap = (message) => {
      taken.messages.push(message);
      taken.bytes += message.byteLength;
      if (taken.bytes > kMostBytes) void this.save();
    };
    this.show();
  }

  private async save(): Promise<void> {
    const { of, taken } = this;
    this.taken = null;
    of!.source.tap = null;
    if (taken!.messages.length === 0) return this.say(say.nothing, true);
    try {
      const [{ writeRecording }, { samplesOf }, { writeStreamInfo }] = await Promise.all([
        import('./recordingFile'),
        import('./sample'),
        import('./cdrWriter'),
      ]);
      const info = of!.info();
      const samples = samplesOf(of!.stream, taken!.messages);
      const content = await writeRecording(of!.stream, info === null ? null : writeStreamInfo(info), samples);
      const name = `${of!.stream}-${new Date().toISOString().slice(0, 19).replace(/[-:]/g, '').replace('T', '-')}.mcap`;
      download(name, content);
      this.say(say.savedHere(name, taken!.messages.length, content.size));
    } catch (error) {
      this.say(say.failed(error instanceof Error ? error.message : String(error)), true);
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
    this.button.hidden = this.of === null;
    this.button.setAttribute('aria-pressed', String(isRecording));
    const title = isRecording ? say.stop : this.serverHasNone ? say.startHere : say.start;
    this.button.title = title;
    this.button.setAttribute('aria-label', title);
    this.pill.hidden = !isRecording && performance.now() > this.saidUntil;
    if (!isRecording) return;
    this.pill.className = 'on';
    const { server, taken } = this;
    const elapsedMs = taken !== null ? performance.now() - taken.since : Date.now() - server!.started_ns / 1e6;
    const bytes = taken?.bytes ?? server!.bytes;
    setText(this.pill, say.running(clockText(elapsedMs).replace(/\.\d+$/, ''), bytes));
  }
}
