// SPDX-License-Identifier: Apache-2.0
// What the page tells a person, derived from what it knows. Pure.
import { sentence } from './sentence';
import type { Missing } from './source';
import { text } from './strings';

export type State =
  | 'unsupported'
  | 'connecting'
  | 'lost'
  | 'refused'
  | 'empty'
  | 'waiting'
  | 'starting'
  | 'live'
  | 'file'
  | 'shifted'
  | 'stalled'
  | 'ended';

/** Why a server lets a page not watch: it has as many as it may, no stream can have such a name, or it wants a token. */
export type Refusal = 'places' | 'name' | 'token';

export interface Facts {
  problem: string | null; // why nothing can be shown here at all
  everConnected: boolean;
  connected: boolean; // the WebSocket or, while no stream is chosen, the list
  retryInS: number | null; // until the next attempt
  refusal: Refusal | null; // of the last one
  stream: string | null; // chosen
  opening?: string | null; // the recording that is asked of the server, before anything is shown
  announced: boolean; // the server knows the stream
  seen: boolean; // a frame of it was shown
  serverState: 'starting' | 'running' | 'stalled' | 'ended' | null;
  serverMessage: string;
  quietMs: number; // since the last frame arrived
  frameRate: number; // nominal; 0: not known
  hint: string;
  file: 'playing' | 'paused' | 'surface' | null; // what is shown is no stream
  missing?: Missing | null; // of a recording: why its next frame does not come
  shifted: 'playing' | 'paused' | null; // what is shown is of a stream, but was before
}

export interface Presentation {
  state: State;
  label: string; // a word or two for the badge
  title: string; // of the card over the picture; empty: none
  text: string;
  hint: string; // a command to type
  note: string; // a line over the picture, which is shown all the same; empty: none
  dim: boolean; // the picture is not of now
}

const kStartHint = 'relievo-server serve';

/** How long a live stream may be silent. */
export function patienceMs(frameRate: number): number {
  return Math.max(2000, frameRate > 0 ? 10_000 / frameRate : 0);
}

export function present(facts: Facts): Presentation {
  const make = (state: State, label: string, rest: Partial<Presentation> = {}): Presentation => ({
    state,
    label,
    title: '',
    text: '',
    hint: '',
    note: '',
    dim: false,
    ...rest,
  });
  const name = facts.stream ?? '';
  const say = text.states;
  if (facts.problem !== null) {
    return make('unsupported', say.unsupported[0], { title: say.unsupported[1], text: facts.problem, dim: true });
  }
  if (facts.file !== null && (facts.missing ?? null) !== null) {
    const { why, passing } = facts.missing!;
    const [label, title, late] = say.late;
    return make('stalled', label, { title, text: [why === '' ? late : sentence(why), passing ? say.lateGoesOn : ''].join(' ').trim(), dim: true });
  }
  if (facts.file !== null) {
    const { playing, paused, surface } = text.file;
    return make('file', { playing, paused, surface }[facts.file]);
  }
  if (facts.shifted !== null) {
    const now = present({ ...facts, shifted: null });
    const how = text.shifted[facts.shifted];
    return make('shifted', isOver(now) ? text.shifted.over(how, now.label) : how);
  }
  if (!facts.connected) {
    if (!facts.everConnected && facts.retryInS === null) {
      return make('connecting', say.connecting[0], { title: say.connecting[1], text: say.connecting[2] });
    }
    if (facts.refusal === 'name') return make('refused', say.noName[0], { title: say.noName[1], text: say.noName[2], dim: true });
    if (facts.refusal === 'token') return make('refused', say.noToken[0], { title: say.noToken[1], text: say.noToken[2], dim: true });
    if (facts.refusal === 'places') {
      return make('lost', say.full[0], { title: say.full[1], text: say.full[2] + say.again(facts.retryInS), dim: true });
    }
    const what = facts.seen ? say.lastPicture : facts.everConnected ? '' : say.filesOpen;
    return make('lost', say.lost[0], { title: say.lost[1], text: what + say.again(facts.retryInS), dim: true });
  }
  if (facts.stream === null && (facts.opening ?? null) !== null) {
    return make('connecting', say.opening[0], { title: say.opening[1](facts.opening!), text: say.opening[2] });
  }
  if (facts.stream === null) {
    return make('empty', say.empty[0], { title: say.empty[1], text: say.empty[2], hint: facts.hint || kStartHint });
  }
  if (!facts.announced) {
    if (facts.seen) return make('ended', say.ended[0], { title: say.ended[1], text: say.left(name), dim: true });
    return make('waiting', say.waiting, { title: say.waitingFor(name), text: say.noSuch, hint: facts.hint });
  }
  if (facts.serverState === 'ended') {
    return make('ended', say.ended[0], { title: say.ended[1], text: facts.serverMessage || say.noMore, dim: true });
  }
  if (!facts.seen) {
    return make('starting', say.starting[0], { title: say.starting[1], text: facts.serverMessage || say.announced(name) });
  }
  const silent = facts.quietMs > patienceMs(facts.frameRate);
  if (facts.serverState === 'stalled' || silent) {
    const since = silent ? say.silent(Math.floor(facts.quietMs / 1000)) : '';
    return make('stalled', say.stalled[0], { title: say.stalled[1], text: since + (facts.serverMessage || say.comesBack), dim: true });
  }
  return make('live', say.live, { note: facts.serverMessage });
}

/** Nothing comes of it any more, as far as is known. */
export function isOver({ state }: Presentation): boolean {
  return state === 'lost' || state === 'refused' || state === 'ended';
}

/** Seconds to wait before attempt n (0, 1, ...) to connect again. */
export function backoffS(attempt: number): number {
  return Math.min(10, 2 ** Math.min(attempt, 4));
}
