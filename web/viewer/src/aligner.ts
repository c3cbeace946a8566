// SPDX-License-Identifier: Apache-2.0
// Where one rig stands to another, by places that a person shows on both surfaces: by turns one of the first, then the
// same of the other, three times or more.
import type { Mark } from './overlay';
import type { Vec3 } from './pick';
import { moved, rigidFromPairs } from './rigid';
import type { View } from './view';

const kStill_px = 5; // a click moves no further

/** What a person is to know. */
export interface Aligning {
  readonly name: string; // of the stream that is being placed
  readonly next: string; // of which stream the next place is wanted
  readonly pairs: number; // whole ones
  readonly rms: number | null; // metres, of what is left between them; null: it has no place yet
  readonly wrong: boolean; // the last click was on no place of `next`
}

export class Aligner {
  private name: string | null = null;
  private pairs: [from: Vec3, to: Vec3][] = []; // on the stream's surface and on the first
  private on: Vec3 | null = null; // on the first: the other one's is still missing
  private rms: number | null = null;
  private wrong = false;
  private pressed: { x: number; y: number } | null = null;

  constructor(
    private readonly view: View,
    private readonly changed: (now: Aligning | null) => void,
  ) {
    const { canvas, overlay } = view;
    const others = overlay.marks;
    overlay.marks = () => [...others(), ...this.marks()];
    canvas.addEventListener('pointerdown', (event) => {
      this.pressed = event.isPrimary && event.button === 0 ? { x: event.offsetX, y: event.offsetY } : null;
    });
    canvas.addEventListener('pointerup', (event) => {
      const at = { x: event.offsetX, y: event.offsetY };
      const isClick = this.pressed !== null && Math.hypot(at.x - this.pressed.x, at.y - this.pressed.y) < kStill_px;
      if (isClick && this.name !== null) this.add(at);
    });
  }

  get of(): string | null {
    return this.name;
  }

  /** Begins anew, with this stream where it stands by itself; null: no more. What was found stays. */
  begin(name: string | null): void {
    this.name = name;
    this.pairs = [];
    this.on = this.rms = null;
    this.wrong = false;
    if (name !== null) this.view.place(name, null);
    this.tell();
  }

  private add(at: { x: number; y: number }): void {
    const hit = this.view.pick(at);
    const name = this.name!;
    this.wrong = hit?.stream !== (this.on === null ? this.view.name : name);
    if (hit !== null && !this.wrong) {
      if (this.on === null) {
        this.on = hit.point;
      } else {
        this.pairs.push([hit.point, this.on]);
        this.on = null;
        this.rms = rigidFromPairs(this.pairs)?.rms ?? null;
      }
    }
    this.tell();
  }

  /** The stream gets the place that was found, where one is determined. */
  apply(): void {
    const found = rigidFromPairs(this.pairs);
    if (found === null || this.name === null) return;
    this.view.place(this.name, found.rigid);
    this.name = null;
    this.tell();
  }

  private marks(): Mark[] {
    if (this.name === null) return [];
    const at = (stream: string, point: Vec3, i: number): Mark[] => {
      const pose = this.view.poseOf(stream);
      if (pose === null) return [];
      const place = moved(pose, point);
      return [{ points: [place], dots: [place], text: String(i + 1) }];
    };
    const { name, view, on, pairs } = this;
    const both = pairs.flatMap(([from, to], i) => [...at(view.name, to, i), ...at(name, from, i)]);
    return on === null ? both : [...both, ...at(view.name, on, pairs.length)];
  }

  private tell(): void {
    const { name, pairs, rms, wrong } = this;
    this.changed(name === null ? null : { name, next: this.on === null ? this.view.name : name, pairs: pairs.length, rms, wrong });
    this.view.invalidate();
  }
}
