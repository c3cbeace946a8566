// SPDX-License-Identifier: Apache-2.0
// Where a board was seen by camera and projector, and how it was tilted. The words are the page's own: a picture's
// would be as small as it is shown.
import { element, make, setText } from '../dom';

import { calibrationPicture, kSides, type Calibration, type Side } from './calibration';
import { draw } from './draw';
import { text } from './strings';

const say = text.calibration;

export class CoverageFigure {
  private readonly root = element('seen');
  private readonly tilts: ReadonlyMap<Side, HTMLElement>;

  constructor() {
    setText(element('coverage-camera'), say.camera);
    setText(element('coverage-projector'), say.projector);
    setText(element('coverage-caption'), say.coverage);
    this.tilts = new Map(kSides.map((side) => [side, make('li')]));
    element('tilts').append(...this.tilts.values());
  }

  async show({ coverage, tilts }: Calibration): Promise<void> {
    const picture = coverage ? await calibrationPicture('coverage') : null;
    if (picture !== null) draw(element<HTMLCanvasElement>('coverage'), picture);
    for (const [side, row] of this.tilts) {
      row.dataset['side'] = side;
      row.dataset['seen'] = String(tilts.includes(side));
      setText(row, say.tilt(say.sides[side], tilts.includes(side)));
    }
    this.root.hidden = picture === null;
  }

  hide(): void {
    this.root.hidden = true;
  }
}
