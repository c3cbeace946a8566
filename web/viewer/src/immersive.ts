// SPDX-License-Identifier: Apache-2.0
// The scene around a person who wears a headset (WebXR), at its true scale in metres: they begin where the
// rig's camera stands, and walk. Loaded where the browser has WebXR alone.
import { element, make } from './dom';
import { text } from './strings';
import type { View } from './view';

const kModes = ['immersive-ar', 'immersive-vr'] as const; // the surface in the person's room, where there is such a headset

/** Adds the button that enters and leaves, where a headset is there or comes. */
export class Immersive {
  private readonly button = make(
    'button',
    { id: 'immersive', type: 'button', hidden: true, onclick: () => void this.toggle() },
    text.immersive.enter,
  );
  private mode: XRSessionMode | null = null;
  private session: XRSession | null = null;

  /** `failed` is told why it could not be entered. */
  constructor(
    private readonly xr: XRSystem,
    private readonly view: View,
    private readonly failed: (why: string) => void,
  ) {
    element('ways').before(this.button);
    this.button.title = text.immersive.title;
    xr.addEventListener('devicechange', () => void this.look());
    void this.look();
  }

  private async look(): Promise<void> {
    this.mode = null;
    for (const mode of kModes) {
      if (await this.xr.isSessionSupported(mode).catch(() => false)) {
        this.mode = mode;
        break;
      }
    }
    this.button.hidden = this.mode === null;
  }

  private async toggle(): Promise<void> {
    if (this.session !== null) return this.session.end();
    if (this.mode === null) return;
    try {
      const session = await this.xr.requestSession(this.mode);
      this.session = session;
      session.addEventListener('end', () => this.ended());
      await this.view.immerse(session);
      this.button.textContent = text.immersive.leave;
    } catch (error) {
      void this.session?.end().catch(() => undefined);
      this.failed(text.immersive.failed(error instanceof Error ? error.message : String(error)));
    }
  }

  private ended(): void {
    this.session = null;
    this.button.textContent = text.immersive.enter;
  }
}
