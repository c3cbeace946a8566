// SPDX-License-Identifier: Apache-2.0
// Files of this device, by the picker or dropped on the page. Nothing is sent anywhere.
import { element, make } from './dom';

const kAccept = '.mcap,.ply,.glb';

export class FilePicker {
  private readonly input = make('input', { type: 'file', accept: kAccept, hidden: true, id: 'file' });

  /** `given`: one, or several that were dropped at once. */
  constructor(given: (files: readonly [File, ...File[]]) => void) {
    document.body.append(this.input);
    this.input.onchange = () => {
      const file = this.input.files?.[0];
      if (file !== undefined) given([file]);
      this.input.value = ''; // the same one may be chosen again
    };
    const drop = element('drop');
    window.addEventListener('dragover', (event) => {
      if (event.dataTransfer?.types.includes('Files') !== true) return;
      event.preventDefault();
      drop.hidden = false;
    });
    window.addEventListener('dragleave', (event) => {
      if (event.relatedTarget === null) drop.hidden = true;
    });
    window.addEventListener('drop', (event) => {
      event.preventDefault();
      drop.hidden = true;
      const [file, ...others] = event.dataTransfer?.files ?? [];
      if (file !== undefined) given([file, ...others]);
    });
  }

  ask(): void {
    this.input.click();
  }
}
