// SPDX-License-Identifier: Apache-2.0
// What stands beside the surface: the camera's picture, the stripes, or both.
import type { Split } from './display';
import type { DecodedFrame } from './messages';
import { Picture } from './picture';
import { text } from './strings';
import type { Stripes } from './stripes';

const kAgainMs = 2000; // before what did not come is asked for again

export class Pictures {
  private readonly texture = new Picture('picture');
  private stripes: Stripes | null = null; // loaded when they are wanted first
  private wantsStripes = false;
  private isLoading = false; // them, or waits to do so again
  private camera: string | null = null;
  private frame: DecodedFrame | null = null;

  /** `alone`: the stream comes as its picture alone, which fills the page. */
  set(split: Split, alone: boolean): void {
    this.texture.on = split === 'picture' || split === 'both' || alone;
    this.wantsStripes = split === 'stripes' || split === 'both';
    document.body.classList.toggle('picture-alone', alone);
    this.setStripes();
  }

  /** What is on the screen: it is open until the next. */
  show(frame: DecodedFrame): void {
    this.frame = frame;
    this.texture.show(frame.texture, frame.texture === null ? text.noPicture : text.picture);
    this.stripes?.show(frame);
  }

  /** The stream whose camera the server has; null: it has none, or what is shown is not of now. */
  watch(camera: string | null): void {
    this.camera = camera;
    this.stripes?.watch(camera);
  }

  /** The place under the cursor, 0..1 from the upper left corner. */
  point(at: [number, number] | null): void {
    this.texture.point(at);
    this.stripes?.point(at);
  }

  private setStripes(): void {
    if (this.stripes !== null) this.stripes.on = this.wantsStripes;
    else if (this.wantsStripes && !this.isLoading) this.loadStripes();
  }

  private loadStripes(): void {
    this.isLoading = true;
    const useStripes = ({ Stripes }: typeof import('./stripes')): void => {
      this.stripes = new Stripes();
      this.stripes.watch(this.camera);
      if (this.frame !== null) this.stripes.show(this.frame);
      this.setStripes();
    };
    const again = (): void => {
      this.isLoading = false;
      this.setStripes();
    };
    import('./stripes').then(useStripes, () => window.setTimeout(again, kAgainMs)); // the server has gone, and may come back
  }
}
