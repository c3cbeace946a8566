// SPDX-License-Identifier: Apache-2.0
// The first of the page's code, and little of it: starts what takes its time, while the rest is loaded.
import { fetchList, hold, holdList, openSocket, socketUrl } from './early';
import { hasOffscreen, startDecoder, startStage } from './workers';

const connect = (stream: string): void => {
  const url = socketUrl(stream, document.baseURI);
  hold(url, openSocket(url)); // without credit it receives no frames
};

// As the viewer chooses.
const wanted = new URLSearchParams(location.search);
const asked = (wanted.get('stream') ?? '').split(',').find((name) => name !== '');
const list = fetchList(document.baseURI);
if (asked !== undefined) connect(asked);
else if (wanted.get('recording') === null) list.then(({ streams: [first] }) => first && connect(first.name)).catch(() => undefined);
holdList(list);
hold('decoder', startDecoder());
if (hasOffscreen()) hold('stage', startStage());

if (document.readyState === 'loading') await new Promise((parsed) => document.addEventListener('DOMContentLoaded', parsed));
await import('./main');
