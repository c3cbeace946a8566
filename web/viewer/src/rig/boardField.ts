// SPDX-License-Identifier: Apache-2.0
// Which board is held before the camera: its kind, and its sizes as `relievo-server calibrate geometry --board` has them.
import { chooser, make, setText } from '../dom';
import { text } from './strings';

const say = text.calibration;
const kKey = 'relievo.board';
const kUsual = { chessboard: 'chessboard:9x7:25mm', charuco: 'charuco:10x8:25mm:18mm' } as const;
type BoardKind = keyof typeof kUsual;

export class BoardField {
  private readonly field = make('input', {
    id: 'calibration-board',
    value: localStorage.getItem(kKey) ?? kUsual.chessboard,
    spellcheck: false,
    autocomplete: 'off',
    oninput: () => this.show(),
  });
  private readonly kinds = chooser(say.board, [
    ['chessboard', say.boards.chessboard],
    ['charuco', say.boards.charuco],
  ] as const, (kind) => {
    this.field.value = kUsual[kind];
    this.show();
  });
  private readonly about = make('small', { className: 'quiet' });
  readonly root = make(
    'div',
    { className: 'board' },
    this.kinds.row,
    make('label', { className: 'row' }, make('span', {}, say.boardSize), this.field),
    this.about,
  );

  constructor() {
    this.show();
  }

  /** Kept for the next visit. */
  get value(): string {
    localStorage.setItem(kKey, this.field.value);
    return this.field.value.trim();
  }

  private show(): void {
    const kind: BoardKind = this.field.value.trim().startsWith('charuco') ? 'charuco' : 'chessboard';
    this.kinds.set(kind);
    setText(this.about, say.boardParts[kind]);
  }
}
