// SPDX-License-Identifier: Apache-2.0
// Screenshots of one look, desktop or phone, dark or light, side by side in one picture with their names.
const kJpegQuality = 80;

/** `look`: as phone-light; `shots`: `name` and `png` (base64) of each; `newPage` opens a page with such options. */
export async function makeSheet(newPage, path, look, shots) {
  const isPhone = look.startsWith('phone');
  const width = isPhone ? 240 : 400;
  const page = await newPage({ viewport: { width: isPhone ? 1270 : 1240, height: 100 }, colorScheme: look.endsWith('light') ? 'light' : 'dark' });
  const figures = shots.map(({ name, png }) => `<figure><img width=${width} src="data:image/png;base64,${png}"><figcaption>${name}</figcaption></figure>`);
  await page.setContent(`<meta name="color-scheme" content="dark light"><style>
    body { margin: 8px; display: flex; flex-wrap: wrap; gap: 8px; font: 13px sans-serif; background: light-dark(#fff, #000); }
    figure { margin: 0; text-align: center } img { display: block; margin-bottom: 3px; border-radius: 6px; outline: 1px solid #8886 }</style>${figures.join('')}`);
  await page.waitForTimeout(300);
  await page.screenshot({ path, quality: kJpegQuality, fullPage: true });
  await page.close();
}
