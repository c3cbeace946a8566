// SPDX-License-Identifier: Apache-2.0
// Three channels' histograms over each other, in the page's colours. Heights go by the square root, so that
// few clipped pixels are seen too.

const kChannels = ['red', 'green', 'blue'] as const;

export function drawHistogram(
  canvas: HTMLCanvasElement,
  of: Readonly<Record<'red' | 'green' | 'blue', readonly number[]>>,
): void {
  const ratio = Math.min(window.devicePixelRatio, 2);
  const [width, height] = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
  canvas.width = width;
  canvas.height = height;
  const c = canvas.getContext('2d')!;
  const style = getComputedStyle(canvas);
  const most = Math.sqrt(Math.max(1, ...kChannels.flatMap((channel) => of[channel])));
  c.strokeStyle = style.getPropertyValue('--line');
  for (let quarter = 0; quarter <= 4; ++quarter) {
    const x = Math.min(width - 0.5, Math.max(0.5, (quarter / 4) * width));
    c.beginPath();
    c.moveTo(x, 0);
    c.lineTo(x, height);
    c.stroke();
  }
  c.lineWidth = 1.5 * ratio;
  c.lineJoin = 'round';
  for (const channel of kChannels) {
    const bins = of[channel];
    const at = (i: number): [number, number] => [
      (i / bins.length) * width,
      height - (Math.sqrt(bins[i]!) / most) * (height - 2 * ratio),
    ];
    c.beginPath();
    c.moveTo(0, height);
    bins.forEach((_, i) => {
      const [x, y] = at(i);
      c.lineTo(x, y);
      c.lineTo(x + width / bins.length, y);
    });
    c.lineTo(width, height);
    const colour = style.getPropertyValue(`--channel-${channel}`);
    c.globalAlpha = 0.16;
    c.fillStyle = colour;
    c.fill();
    c.globalAlpha = 1;
    c.strokeStyle = colour;
    c.stroke();
  }
}
