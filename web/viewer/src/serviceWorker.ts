// SPDX-License-Identifier: Apache-2.0
// Keeps the page's own files, so that it opens without its server and shows files of the device. Nothing else is kept:
// no answer of the API, no stream, no recording, and not the form that asks for a token.
/// <reference lib="webworker" />
export {};
declare const self: ServiceWorkerGlobalScope;

// Put in by the build (vite.config.ts).
declare const RELIEVO_FILES: readonly string[]; // as in an address, below the scope; './' is the page
declare const RELIEVO_VERSION: string; // a hash of their contents

const kPrefix = 'relievo-page-';
const kCache = kPrefix + RELIEVO_VERSION;
const kPage = './';
const kPatienceMs = 5000; // for a server that neither answers nor refuses

const address = (file: string): string => new URL(file, self.registration.scope).href;
const kept = new Set(RELIEVO_FILES.filter((file) => file !== kPage).map(address));

self.addEventListener('install', (event) => {
  // All or none: where a token is asked for, this fails, and the next visit tries again.
  const filled = caches.open(kCache).then((cache) => cache.addAll(RELIEVO_FILES.map(address)));
  event.waitUntil(filled.then(() => self.skipWaiting()));
});

self.addEventListener('activate', (event) => {
  event.waitUntil(dropOld().then(() => self.clients.claim()));
});

self.addEventListener('fetch', (event) => {
  const { request } = event;
  if (request.method !== 'GET') return;
  const url = new URL(request.url);
  url.search = url.hash = '';
  if (request.mode === 'navigate' && url.href === address(kPage)) event.respondWith(page(request));
  else if (kept.has(url.href)) event.respondWith(own(url.href, request));
});

async function dropOld(): Promise<void> {
  const names = await caches.keys();
  await Promise.all(names.filter((name) => name.startsWith(kPrefix) && name !== kCache).map((name) => caches.delete(name)));
}

async function find(url: string): Promise<Response | undefined> {
  return (await caches.open(kCache)).match(url, { ignoreVary: true });
}

// The server's, so that a new version is seen at once and a token is asked for; what is kept, where there is no server.
async function page(request: Request): Promise<Response> {
  const fetched = fetch(request);
  const late = new Promise<null>((resolve) => setTimeout(() => resolve(null), kPatienceMs));
  const answer = await Promise.race([fetched.catch(() => null), late]);
  return answer ?? (await find(address(kPage))) ?? fetched;
}

// Their names have a hash of what is in them.
async function own(url: string, request: Request): Promise<Response> {
  return (await find(url)) ?? fetch(request);
}
