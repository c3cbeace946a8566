// SPDX-License-Identifier: Apache-2.0
// What the page tells a person, derived from what it knows. Pure.
import { text } from './strings';

export type State =
  | 'unsupported'
  | 'connecting'
  | 'lost'
  | 'empty'
  | 'waiting'
  | 'starting'
  | 'live'
  | 'file'
  | 'shifted'
  | 'stalled'
  | 'ended';

export interface Facts {
  problem: string | null; // why nothing can be shown here at all
  everConnected: boolean;
  connected: boolean; // the WebSocket or, while no stream is chosen, the list
  retryInS: number | null; // until the next attempt
  stream: string | null; // chosen
  announced: boolean; // the server knows the stream
  seen: boolean; // a frame of it was shown
  serverState: 'starting' | 'running' | 'stalled' | 'ended' | null;
  serverMessage: string;
  quietMs: number; // since the last frame arrived
  frameRate: number; // nominal; 0: not known
  hint: string;
  file: 'playing' | 'paused' | 'surface' | null; // what is shown is no stream
  shifted: 'playing' | 'paused' | null; // what is shown is of a stream, but was before
}

export interface Presentation {
  state: State;
  label: string; // a word or two for the badge
  title: string; // of the card over the picture; empty: none
  text: string;
  hint: string; // a command to type
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
    dim: false,
    ...rest,
  });
  const name = facts.stream ?? '';
  if (facts.problem !== null) {
    return make('unsupported', 'Not possible', { title: 'Nothing can be shown here', text: facts.problem, dim: true });
  }
  if (facts.file !== null) {
    const { playing, paused, surface } = text.file;
    return make('file', { playing, paused, surface }[facts.file]);
  }
  if (facts.shifted !== null) return make('shifted', text.shifted[facts.shifted]);
  if (!facts.connected) {
    if (!facts.everConnected && facts.retryInS === null) {
      return make('connecting', 'Connecting', { title: 'Connecting', text: 'Asking the server for its streams.' });
    }
    const again =
      facts.retryInS === null || facts.retryInS <= 0 ? 'Trying again now.' : `Trying again in ${facts.retryInS} s.`;
    const files = 'Recordings and surfaces of this device open all the same. ';
    const what = facts.seen ? 'What you see is the last picture that arrived. ' : facts.everConnected ? '' : files;
    return make('lost', 'Offline', { title: 'Connection lost', text: what + again, dim: true });
  }
  if (facts.stream === null) {
    return make('empty', 'No streams', {
      title: 'No streams yet',
      text: 'The server is running, but nothing is being captured. Drop a recording or a surface of this device here, or start a stream, which then appears by itself:',
      hint: facts.hint || kStartHint,
    });
  }
  if (!facts.announced) {
    if (facts.seen) {
      return make('ended', 'Ended', {
        title: 'The stream has ended',
        text: `“${name}” left the network. It continues here when it comes back.`,
        dim: true,
      });
    }
    return make('waiting', 'Waiting', {
      title: `Waiting for “${name}”`,
      text: 'There is no stream of that name yet. It appears here when it starts.',
      hint: facts.hint,
    });
  }
  if (facts.serverState === 'ended') {
    return make('ended', 'Ended', {
      title: 'The stream has ended',
      text: facts.serverMessage || 'The source has no more frames. This is its last picture.',
      dim: true,
    });
  }
  if (!facts.seen) {
    return make('starting', 'Starting', {
      title: 'Waiting for the first frame',
      text: facts.serverMessage || `“${name}” is announced; its first surface needs two camera frames.`,
    });
  }
  const silent = facts.quietMs > patienceMs(facts.frameRate);
  if (facts.serverState === 'stalled' || silent) {
    const since = silent ? `No frame for ${Math.floor(facts.quietMs / 1000)} s. ` : '';
    return make('stalled', 'Stalled', {
      title: 'The stream has stalled',
      text: since + (facts.serverMessage || 'It continues by itself when the camera does.'),
      dim: true,
    });
  }
  return make('live', 'Live');
}

/** Seconds to wait before attempt n (0, 1, ...) to connect again. */
export function backoffS(attempt: number): number {
  return Math.min(10, 2 ** Math.min(attempt, 4));
}
