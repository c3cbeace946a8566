// SPDX-License-Identifier: Apache-2.0
// What is done to a page with a <relievo-player>: put into the background, its player moved out, its workers made to hang.
import { kPatienceMs } from './chromium.mjs';

/** Moves the page's player into a window of its own, which is returned, and the page into the background. */
export async function moveOut(page) {
  const [popup] = await Promise.all([
    page.waitForEvent('popup'),
    page.evaluate(() => {
      window.moved_ = document.querySelector('relievo-player');
      window.popup_ = window.open('about:blank', 'popup', 'width=400,height=300');
    }),
  ]);
  await page.evaluate(() => {
    // As in the background: nothing is drawn, timers come late, if ever.
    window.requestAnimationFrame = () => 0;
    window.setTimeout = () => 0;
    window.setInterval = () => 0;
    Object.defineProperty(document, 'hidden', { value: true });
    document.dispatchEvent(new Event('visibilitychange'));
    window.popup_.document.body.append(window.moved_);
    window.frames_ = [];
    window.moved_.addEventListener('frame', ({ detail }) => window.frames_.push(detail.number));
    window.moved_.style.width = '300px';
  });
  popup.setDefaultTimeout(kPatienceMs);
  return popup;
}

/** Counts frames as the page gets them. */
export const countFrames = (page) =>
  page.addInitScript(() => {
    window.received_ = 0;
    const { WebSocket } = window;
    window.WebSocket = class extends WebSocket {
      constructor(...rest) {
        super(...rest);
        this.addEventListener('message', ({ data }) => (window.received_ += typeof data === 'string' ? 0 : 1));
      }
    };
  });

/** While the page's `hang_` is set no decoder hears what it is asked for; the next worker that is started ends that. */
export const hangingDecoders = (page) =>
  page.addInitScript(() => {
    const { Worker } = window;
    window.Worker = class extends Worker {
      constructor(...of) {
        super(...of);
        window.hang_ = false;
      }
      postMessage(message, ...rest) {
        if (!(window.hang_ && message.type === 'decode')) super.postMessage(message, ...rest);
      }
    };
  });

/** Until the page has drawn itself twice, and knows what of it is in sight. */
export const turned = (page) => page.evaluate(() => new Promise((resolve) => setTimeout(() => requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(resolve))))));

/** A tab in the background, as far as a page is told of it; pages without a window are never hidden. */
export const kHide = () => {
  Object.defineProperty(document, 'hidden', { configurable: true, get: () => true });
  document.dispatchEvent(new Event('visibilitychange'));
};
export const kShow = () => {
  delete document.hidden;
  document.dispatchEvent(new Event('visibilitychange'));
};
