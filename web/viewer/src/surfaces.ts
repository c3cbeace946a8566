// SPDX-License-Identifier: Apache-2.0
// Which surfaces there are, the first one and those beside it, and where each stands in the scene.
import type { Label } from './ground';
import type { DecodedFrame } from './messages';
import { pick, type Picked, type Vec3 } from './pick';
import { around, between, placed, type Placement } from './placement';
import { inverse, kNowhere, moved, turned, type Rigid } from './rigid';
import { text } from './strings';
import type { Extent } from './surface';

const kFirst = 0; // number of the first surface, for the painter

/** A surface, in a frame of its own camera. */
export interface Shown {
  readonly id: number; // for the painter
  frame: DecodedFrame | null;
  picture: ImageBitmap | null; // the last there was: to be closed when another takes its place
}

/** A surface beside the first one. */
export interface Beside extends Shown {
  readonly name: string;
  extent: Extent | null; // of its first frame
  readonly comesQuietly: boolean; // the eye stays where it is
  word: string; // what is said of it where it is not of now; empty: it is
}

/** A place of one of the surfaces, in the frame of its own camera. */
export interface Hit extends Picked {
  readonly stream: string;
  readonly surface: DecodedFrame;
  readonly pose: Rigid; // of that frame in the scene's
}

/** A stream's surface as it is shown. */
export interface Seen {
  readonly stream: string;
  readonly surface: DecodedFrame;
  readonly pose: Rigid; // of its camera in the scene
  readonly picture: ImageBitmap | null; // of that surface; open until the next is shown
}

export class Surfaces {
  readonly first: Shown = { id: kFirst, frame: null, picture: null };
  readonly besides: Beside[] = [];
  /** Of the first surface, where there are others beside it. */
  name = '';
  /** Of the first surface. */
  extent: Extent | null = null;
  placement: Placement = 'beside';
  /** Where a person has placed streams, by name. */
  readonly known = new Map<string, Rigid>();
  private nextId = kFirst + 1;
  private poses: Rigid[] = [kNowhere]; // of all
  private readonly rigPlaces = new Map<string, Rigid>(); // where their rigs say that they stand

  get all(): Shown[] {
    return [this.first, ...this.besides];
  }
  get isAlone(): boolean {
    return this.besides.length === 0;
  }

  add(name: string, comesQuietly: boolean): Beside {
    const beside: Beside = { id: this.nextId++, name, frame: null, picture: null, extent: null, comesQuietly, word: '' };
    this.besides.push(beside);
    return beside;
  }

  remove(beside: Beside): void {
    this.besides.splice(this.besides.indexOf(beside), 1);
  }

  /** Where the rig of a stream says that its camera stands; null: it does not say. True where that is new. */
  setRigPlace(name: string, place: Rigid | null): boolean {
    if (JSON.stringify(place) === JSON.stringify(this.rigPlaces.get(name) ?? null)) return false;
    if (place === null) this.rigPlaces.delete(name);
    else this.rigPlaces.set(name, place);
    return true;
  }

  /** Where a stream stands in the first one's frame, by a person's hand or else by both rigs; null: nothing says it. */
  placeOf(name: string): Rigid | null {
    return this.known.get(name) ?? between(this.rigPlaces.get(this.name), this.rigPlaces.get(name));
  }

  /**
   * Whether lengths from this stream to another such one mean something: it stands where both rigs say, or in the first
   * one's frame because a person has put all there. Places clicked by hand are too inexact, side by side means nothing.
   */
  standsTrue(name: string): boolean {
    if (name === this.name) return true;
    if (this.known.has(name)) return false;
    return this.placement === 'together' || this.placeOf(name) !== null;
  }

  /** By what is known now. */
  arrange(): void {
    this.poses = placed(this.extents, this.placement, [null, ...this.besides.map(({ name }) => this.placeOf(name))]);
  }

  /** Of all as they stand; null: nothing is known of the first one. */
  get around(): Extent | null {
    return this.isAlone ? this.extent : around(this.extents, this.poses);
  }

  /** Of a surface's camera in the scene, by its place among all. */
  pose(i: number): Rigid {
    return this.poses[i] ?? kNowhere;
  }

  /** Of a stream's camera in the scene; null: there is no such, or not where the first one is seen `alone`. */
  poseOf(stream: string, alone: boolean): Rigid | null {
    const i = this.names.indexOf(stream);
    return i < 0 || (i > 0 && alone) ? null : this.pose(i);
  }

  /** Those that there is a frame of, the first one first, or that one `alone`. */
  seen(alone: boolean): Seen[] {
    return (alone ? [this.first] : this.all).flatMap(({ frame: surface, picture }, i) =>
      surface === null ? [] : [{ stream: this.names[i]!, surface, pose: this.pose(i), picture }],
    );
  }

  /** A name above each. */
  get labels(): Label[] {
    const names = [this.name, ...this.besides.map(({ name, word }) => text.streams.withWord(name, word))];
    return this.extents.flatMap((extent, i): Label[] => {
      if (extent === null) return [];
      const { min, max } = extent;
      const at: Label['at'] = [(min[0] + max[0]) / 2, min[1] - 0.1 * (max[1] - min[1]), (min[2] + max[2]) / 2];
      return [{ at: moved(this.poses[i]!, at), text: names[i]!, colour: '--text' }];
    });
  }

  private get names(): string[] {
    return [this.name, ...this.besides.map(({ name }) => name)];
  }
  private get extents(): (Extent | null)[] {
    return [this.extent, ...this.besides.map(({ extent }) => extent)];
  }
}

/** Of surfaces as they are seen, what a ray of the scene meets first. */
export function pickOf(seen: readonly Seen[], { origin, direction }: { origin: Vec3; direction: Vec3 }): Hit | null {
  let first: Hit | null = null;
  for (const { stream, surface, pose } of seen) {
    const back = inverse(pose);
    const picked = pick(surface, moved(back, origin), turned(back, direction));
    if (picked !== null && (first === null || picked.along < first.along)) first = { ...picked, stream, surface, pose };
  }
  return first;
}
