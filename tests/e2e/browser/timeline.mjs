// SPDX-License-Identifier: Apache-2.0
// The cursor over the time line, the picture that it shows, and the marks that are drawn on it.
import { eventually } from './chromium.mjs';

const kAgainMs = 5000; // a picture that a busy machine decodes too late is tried again with the next move

/** Goes to the frame of this index, as a hand on the slider does, which is as long as what is there: new frames come to it later. */
export const seek = (page, index) =>
  page.waitForFunction((i) => {
    const { times, first } = window.relievo.diagnostics().playback;
    const slider = document.querySelector('#timeline input[type=range]');
    const at = times[i - first];
    if (!(at >= Number(slider.min) && at <= Number(slider.max))) return false;
    slider.value = String(Math.min(at + 1e-3, Number(slider.max)));
    slider.dispatchEvent(new Event('input', { bubbles: true }));
    return true;
  }, index);

/**
 * Points at the frame of this index, and waits for the picture of it, or of the nearest one before that is
 * kept apart: of many frames not each has its own. `index` of what is returned says which it is.
 */
export async function pointAt(page, index) {
  let at = -1;
  let again = 0;
  const seen = () => page.evaluate(() => ({ ...document.querySelector('.preview canvas')?.dataset }));
  let last = {};
  await eventually(
    () => `no picture of frame ${index} at ${at}, but ${JSON.stringify(last)}`,
    async () => {
      const place = await placeOf(page, index); // a live stream's time line grows meanwhile
      if (Math.abs(place.x - at) > 0.5 || Date.now() > again) {
        await page.mouse.move(place.x - 30, place.y);
        await page.mouse.move(place.x, place.y);
        at = place.x;
        again = Date.now() + kAgainMs;
      }
      last = await seen();
      return last.index === String(place.pictured);
    },
  );
  return page.evaluate(() => {
    const canvas = document.querySelector('.preview canvas');
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    let [sum, squares, hash] = [0, 0, 2166136261];
    for (let i = 0; i < data.length; i += 4) {
      sum += data[i + 1];
      squares += data[i + 1] ** 2;
      hash = Math.imul(hash ^ data[i + 1], 16777619) >>> 0;
    }
    const n = data.length / 4;
    return {
      index: Number(canvas.dataset.index),
      frame: Number(canvas.dataset.frame),
      width: canvas.clientWidth,
      height: canvas.clientHeight,
      deviation: Math.sqrt(squares / n - (sum / n) ** 2),
      hash,
      time: document.querySelector('.preview span')?.textContent,
    };
  });
}

/** Of each frame of the time line: where it is, pixels, how many high the mark at it is, and whether it is of a colour of style.css. */
export const marksAt = (page, colour) =>
  page.evaluate((property) => {
    const canvas = document.querySelector('#timeline .track canvas');
    const { width, height } = canvas;
    const context = canvas.getContext('2d');
    const probe = new OffscreenCanvas(1, 1).getContext('2d');
    probe.fillStyle = getComputedStyle(canvas).getPropertyValue(property);
    probe.fillRect(0, 0, 1, 1);
    const wanted = probe.getImageData(0, 0, 1, 1).data;
    const { times } = window.relievo.diagnostics().playback;
    return times.map((t) => {
      const x = Math.round(((t - times[0]) / (times.at(-1) - times[0])) * width);
      const { data, width: columns } = context.getImageData(Math.max(0, x - 2), 0, 4, height);
      const isDrawn = (column, row) => data[(row * columns + column) * 4 + 3] > 60;
      let high = 0;
      let ofColour = false;
      for (let column = 0; column < columns; ++column) {
        let rows = 0;
        while (rows < height && isDrawn(column, height - 1 - rows)) ++rows;
        high = Math.max(high, rows);
        const bottom = ((height - 1) * columns + column) * 4;
        ofColour ||= rows > 0 && [0, 1, 2].every((c) => Math.abs(data[bottom + c] - wanted[c]) < 24);
      }
      return { x, high, ofColour };
    });
  }, colour);

const placeOf = (page, index) =>
  page.evaluate((i) => {
    const { times, first } = window.relievo.diagnostics().playback;
    const { left, top, width, height } = document.querySelector('#timeline .track').getBoundingClientRect();
    const inset = 8;
    const apart = Math.max(1, Math.floor((times.length * 6) / width)); // a picture each 6 pixels
    const share = (times[i - first] + 1e-3 - times[0]) / (times[times.length - 1] - times[0]);
    return { x: left + inset + share * (width - 2 * inset) + 0.6, y: top + height / 2, pictured: Math.max(first, i - (i % apart)) };
  }, index);
