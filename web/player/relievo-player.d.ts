// SPDX-License-Identifier: Apache-2.0
/** How the surface is drawn. */
export type Mode = 'textured' | 'shaded' | 'wireframe' | 'points' | 'normals' | 'depth' | 'confidence';
export type Theme = 'auto' | 'dark' | 'light';

/** `idle`: no src, or not in a page. `live` and `stalled`: a live stream; `stalled` also a recording of which nothing comes. `behind`: a live stream as it was. `file`: a recording. */
export type PlayerState = 'idle' | 'loading' | 'live' | 'stalled' | 'ended' | 'lost' | 'behind' | 'file' | 'failed';

export interface FrameDetail {
  /** Of the camera frame. */
  number: number;
  vertices: number;
  triangles: number;
}

export interface RelievoPlayerEventMap extends HTMLElementEventMap {
  /** `state` has changed. */
  statechange: CustomEvent<{ state: PlayerState; message: string }>;
  /** `duration` has changed: it grows while the recording is being written, or a stream is kept. */
  durationchange: Event;
  /** A frame was drawn. */
  frame: CustomEvent<FrameDetail>;
}

/**
 * `<relievo-player src=... mode=... theme=... controls grid loop>`: 3D video from a Relievo gateway, or a recording, which plays
 * by itself. Attributes and properties of the same name are one.
 */
export interface RelievoPlayerElement extends HTMLElement {
  /** A recording (.mcap), or the address of a gateway's page with ?stream=NAME or ?recording=FILE. */
  src: string;
  /** Default: textured. Any other text is that. */
  mode: Mode;
  /** Default: dark. auto: as the reader's system. */
  theme: Theme;
  /** Whether the time line is shown. */
  controls: boolean;
  /** Whether floor and axes are shown, in metres. */
  grid: boolean;
  /** Whether a recording begins again at its end. One that is still being written goes on there with what comes. */
  loop: boolean;
  readonly state: PlayerState;
  /** For a person; empty while all is well. Also why a surface is shown without its texture. */
  readonly message: string;
  readonly paused: boolean;
  /**
   * Seconds: of a recording from its start, of a live stream from the oldest frame kept. Setting it seeks. What is set or asked
   * for before there are frames is done when they come, and forgotten with another src. Throws TypeError for NaN and Infinity.
   */
  currentTime: number;
  /** Seconds; of a live stream, of what is kept; of a recording that a gateway is still writing it grows. 0 before the first frame. */
  readonly duration: number;
  /** 0.1 to 8. Throws as above. */
  playbackRate: number;
  play(): void;
  pause(): void;
  /** Back to what is live. */
  goLive(): void;
  /** The first view of the surface as it is now. */
  resetView(): void;
  /** What is seen, as PNG with a transparent ground. Rejects before the first frame. */
  screenshot(): Promise<Blob>;
  addEventListener<K extends keyof RelievoPlayerEventMap>(
    type: K,
    listener: (this: RelievoPlayerElement, event: RelievoPlayerEventMap[K]) => void,
    options?: boolean | AddEventListenerOptions,
  ): void;
  addEventListener(type: string, listener: EventListenerOrEventListenerObject, options?: boolean | AddEventListenerOptions): void;
}

declare global {
  interface HTMLElementTagNameMap {
    'relievo-player': RelievoPlayerElement;
  }
}
