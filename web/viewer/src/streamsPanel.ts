// SPDX-License-Identifier: Apache-2.0
// What there is to see: live streams and recordings of the server, with a picture each, to be shown alone or beside
// the others.
import { Aligner, type Aligning } from './aligner';
import { button, chooser, make, setText } from './dom';
import { kPlacements, type Placement } from './placement';
import { rigPage, type ListedRecording, type ListedStream } from './protocol';
import { sentence } from './sentence';
import { text } from './strings';
import { kThumbnail, Thumbnails } from './thumbnails';
import type { View } from './view';

const say = text.streams;
const kFreshMs = 15_000; // between pictures of a stream that is not shown
const kAgainMs = 2000; // before a folder that could not be listed is asked for again
const kAhead = '50%'; // of the panel's height: pictures so far out of sight are read, too

export interface StreamsPanelEvents {
  choose(name: string): void;
  beside(name: string, on: boolean): void;
  /** A recording in the server's folder, which may still be written. */
  recording(file: string): void;
  placement(placement: Placement): void;
}

interface Row {
  item: HTMLLIElement;
  picture: HTMLCanvasElement;
  about: HTMLElement;
  show: HTMLButtonElement;
  rig: HTMLAnchorElement; // the page that shows what its camera sees
  beside: HTMLButtonElement | null; // recordings of the folder are shown alone
  place: HTMLButtonElement | null;
  file: string | null; // in the folder
  pictureAt: number; // when it was asked for
  isNear: boolean; // in sight, or soon
}

export class StreamsPanel {
  private readonly live = make('ul', { className: 'streams' });
  private readonly none = make('p', { className: 'quiet' }, say.none);
  private readonly folderTitle = make('h3', { hidden: true }, say.recordings);
  private readonly folderProblem = make('p', { className: 'quiet', hidden: true });
  private readonly folder = make('ul', { className: 'streams' });
  private readonly placement: { row: HTMLElement; set(value: Placement): void };
  private readonly note = make('p', { className: 'quiet' }, say.unknownPlaces);
  private readonly rows = new Map<string, Row>();
  private readonly recordings = new Map<string, Row>(); // by file
  private recorded = ''; // what the streams' recorders did when the folder was listed
  private listings = 0; // of the folder, asked for
  private listAgainAt = Infinity; // performance.now()
  private shownFile: string | null = null;
  private readonly thumbnails = new Thumbnails();
  private readonly inSight: IntersectionObserver; // which of the pictures
  private readonly rowOf = new WeakMap<Element, Row>(); // by its picture
  private isOpen = false;
  private readonly aligner: Aligner | null;
  private readonly aligning = make('p', { hidden: true, className: 'aligning' });
  private readonly apply = button(say.apply, say.apply, () => this.aligner?.apply());
  private readonly buttons: HTMLElement;

  constructor(
    body: HTMLElement,
    private readonly events: StreamsPanelEvents,
    private readonly view: View | null,
  ) {
    this.inSight = new IntersectionObserver((entries) => this.look(entries), { root: body.parentElement, rootMargin: `${kAhead} 0px` });
    this.aligner = view === null ? null : new Aligner(view, (now) => this.showAligning(now));
    this.buttons = make('div', { className: 'buttons', hidden: true }, this.apply, button(say.cancel, say.cancel, () => this.aligner?.begin(null)));
    this.aligning.setAttribute('role', 'status');
    this.placement = chooser(
      say.placement,
      kPlacements.map((p) => [p, say.placements[p]] as const),
      (placement) => events.placement(placement),
    );
    body.append(this.live, this.none, this.aligning, this.buttons, this.placement.row, this.note, this.folderTitle, this.folderProblem, this.folder);
  }

  set open(open: boolean) {
    this.isOpen = open;
    if (open) void this.listFolder();
    else {
      this.thumbnails.stop();
      if (this.aligner?.of != null) this.aligner.begin(null);
    }
  }

  /** `first`: shown, and `besides` it; `unknown`: why what is listed may not be so now; empty: it is. */
  show(listed: readonly ListedStream[], first: string | null, besides: readonly string[], unknown: string): void {
    if (!this.isOpen) return;
    const gone = besides.filter((name) => !listed.some((s) => s.name === name));
    const streams: ListedStream[] = [...listed, ...gone.map((name) => ({ name, source: '', state: say.gone }))];
    this.none.hidden = streams.length > 0;
    this.placement.row.hidden = this.note.hidden = besides.length === 0;
    const isKnown = besides.every((name) => this.view !== null && this.view.placeOf(name) !== null);
    setText(this.note, isKnown ? say.knownPlaces : say.unknownPlaces);
    for (const [name, row] of this.rows) {
      if (streams.some((s) => s.name === name)) continue;
      this.remove(row);
      this.rows.delete(name);
    }
    for (const stream of streams) {
      const row = this.rows.get(stream.name) ?? this.add(stream.name);
      const state = unknown !== '' ? unknown : typeof stream.recording === 'string' ? say.recording : stream.state;
      setText(row.about, say.withWord(stream.source, state));
      const isFirst = stream.name === first;
      row.item.classList.toggle('shown', isFirst);
      row.show.setAttribute('aria-pressed', String(isFirst));
      row.beside!.setAttribute('aria-pressed', String(besides.includes(stream.name)));
      row.beside!.disabled = isFirst;
      row.place!.hidden = this.aligner === null || !besides.includes(stream.name);
      row.rig.hidden = stream.camera !== true;
      if (!gone.includes(stream.name) && row.isNear) this.draw(row, stream.name, stream.recording ?? null);
    }
  }

  /** Lists those of the folder anew when one begins or ends. `shown`: the file of that which is shown. */
  showRecordings(streams: readonly ListedStream[], shown: string | null): void {
    if (!this.isOpen) return;
    const recorded = streams.map(({ recorder }) => `${recorder?.file} ${recorder?.state} ${recorder?.message}`).join();
    if (recorded !== this.recorded || performance.now() > this.listAgainAt) void this.listFolder();
    this.recorded = recorded;
    this.shownFile = shown;
    this.markRecording();
  }

  private markRecording(): void {
    for (const [file, { item, show }] of this.recordings) {
      item.classList.toggle('shown', file === this.shownFile);
      show.setAttribute('aria-pressed', String(file === this.shownFile));
    }
  }

  private showAligning(now: Aligning | null): void {
    this.aligning.hidden = this.buttons.hidden = now === null;
    if (now === null) return;
    const words = now.next === now.name ? say.showSame(now.name) : say.showPlace(now.next, now.pairs);
    const found = now.rms !== null ? say.left(now.pairs, now.rms) : now.pairs >= 3 ? say.notDetermined : '';
    setText(this.aligning, [now.wrong ? say.wrongStream(now.next) : '', found, words].filter((part) => part !== '').join(' '));
    this.apply.disabled = now.rms === null;
  }

  private draw(row: Row, name: string, recording: string | null): void {
    const now = performance.now();
    if (now - row.pictureAt < kFreshMs) return;
    row.pictureAt = now;
    this.thumbnails.ask({ stream: name, recording, onto: row.picture });
  }

  private add(name: string): Row {
    const beside = button(say.beside, say.besideTitle(name), () =>
      this.events.beside(name, beside.getAttribute('aria-pressed') !== 'true'),
    );
    const place = button(say.place, say.placeTitle(name), () => this.aligner?.begin(name));
    const row = makeRow(name, () => this.events.choose(name), beside, place);
    this.rows.set(name, row);
    this.live.append(row.item);
    this.watch(row);
    return row;
  }

  // Where the server records into a folder.
  private async listFolder(): Promise<void> {
    const listing = ++this.listings;
    this.listAgainAt = Infinity;
    const { recordings, problem } = await fetchFolder();
    if (listing !== this.listings) return; // asked for again since: what comes then is newer
    if (recordings === null) this.listAgainAt = performance.now() + kAgainMs;
    setText(this.folderProblem, sentence(problem));
    this.folderProblem.hidden = problem === '';
    if (recordings !== null) this.listRecordings(recordings);
    this.folderTitle.hidden = this.recordings.size === 0 && problem === '';
  }

  private listRecordings(recordings: readonly ListedRecording[]): void {
    this.drop(recordings.map(({ file }) => file));
    for (const [i, { file, bytes, recording, cut }] of recordings.entries()) {
      const row = this.recordings.get(file) ?? this.addRecording(file);
      const state = recording ? say.beingRecorded : cut ? say.cut : '';
      setText(row.about, say.withWord(`${(bytes / 1e6).toFixed(1)} MB`, state));
      row.about.title = state === say.cut ? say.cutTitle : '';
      const before = this.folder.children[i];
      if (before !== row.item) this.folder.insertBefore(row.item, before ?? null);
    }
    this.markRecording();
  }

  private addRecording(file: string): Row {
    const row = { ...makeRow(file, () => this.events.recording(file)), file };
    this.recordings.set(file, row);
    this.watch(row);
    return row;
  }

  /** Recordings that are none of these are gone. */
  private drop(files: readonly string[]): void {
    const there = new Set(files);
    for (const [file, row] of this.recordings) {
      if (there.has(file)) continue;
      this.remove(row);
      this.recordings.delete(file);
    }
  }

  private watch(row: Row): void {
    this.rowOf.set(row.picture, row);
    this.inSight.observe(row.picture);
  }

  private remove({ item, picture }: Row): void {
    this.inSight.unobserve(picture);
    this.thumbnails.forget(picture);
    item.remove();
  }

  // Of hundreds of streams and recordings those that nobody looks at are not read.
  private look(entries: readonly IntersectionObserverEntry[]): void {
    for (const { target, isIntersecting } of entries) {
      const row = this.rowOf.get(target)!;
      const { picture, file } = row;
      row.isNear = isIntersecting;
      if (!isIntersecting) this.thumbnails.forget(picture);
      if (picture.dataset['drawn'] !== undefined) continue;
      if (!isIntersecting) row.pictureAt = -Infinity;
      else if (file !== null) this.thumbnails.ask({ stream: null, recording: `recordings/${encodeURIComponent(file)}`, onto: picture });
    }
  }
}

/** `recordings` null: not known, with why unless the list of streams says it, too. */
async function fetchFolder(): Promise<{ recordings: ListedRecording[] | null; problem: string }> {
  try {
    const response = await fetch(new URL('api/recordings', document.baseURI), { cache: 'no-store' });
    if (response.ok) return { ...((await response.json()) as { recordings: ListedRecording[] }), problem: '' };
    if (response.status === 404) return { recordings: [], problem: '' }; // there is no folder
    return { recordings: null, problem: response.status === 401 ? '' : (await response.text()).trim() };
  } catch {
    return { recordings: null, problem: '' };
  }
}

function makeRow(name: string, choose: () => void, beside: HTMLButtonElement | null = null, place: HTMLButtonElement | null = null): Row {
  const ratio = Math.min(window.devicePixelRatio, 2);
  const picture = make('canvas', { width: kThumbnail.width * ratio, height: kThumbnail.height * ratio });
  picture.setAttribute('role', 'img');
  picture.setAttribute('aria-label', say.picture(name));
  const about = make('small', { className: 'quiet' });
  const show = button(say.show, say.showTitle(name), choose);
  const rig = make('a', { href: rigPage(name), title: say.rigTitle, hidden: true }, say.rig);
  const buttons = make('div', { className: 'buttons' }, show, ...(beside === null ? [] : [beside]), ...(place === null ? [] : [place]), rig);
  const item = make('li', {}, picture, make('div', {}, make('b', { title: name }, name), about, buttons));
  return { item, picture, about, show, rig, beside, place, file: null, pictureAt: -Infinity, isNear: false };
}
