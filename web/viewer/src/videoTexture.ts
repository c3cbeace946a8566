// SPDX-License-Identifier: Apache-2.0
// Texture codec 4 of codec/FORMAT.md, picture after picture, by the browser's own decoder. Runs in the worker;
// the page asks whether it can.
import { gridId } from './gridHead';
import type { Notice } from './messages';

const kHeadBytes = 4;
const kUsualCodec = 'avc1.640028'; // High profile, up to 1920x1080
const kLeastSide = 16;
const kPatienceMs = 2000; // a decoder that keeps a picture back for longer is of no use

/** Why this browser decodes no H.264: it does so on https and localhost alone, or not at all. */
export const noVideoHere = (): Notice => (self.isSecureContext ? 'videoUnknown' : 'videoInsecure');

/** Whether the section builds on no other. Any bytes. */
export function videoTextureIsKey(section: Uint8Array): boolean {
  return section.length > kHeadBytes && buildsOn(section) === 0;
}

function buildsOn(section: Uint8Array): number {
  return new DataView(section.buffer, section.byteOffset, section.byteLength).getUint32(0, true);
}

/** The name that WebCodecs wants, of the unit's sequence parameter set; throws where it has none. */
export function codecName(unit: Uint8Array): string {
  for (let i = 0; i + 6 < unit.length; ++i) {
    const isSequence = unit[i] === 0 && unit[i + 1] === 0 && unit[i + 2] === 1 && (unit[i + 3]! & 0x1f) === 7;
    if (!isSequence) continue;
    const hex = [...unit.subarray(i + 4, i + 7)].map((byte) => byte.toString(16).padStart(2, '0'));
    return `avc1.${hex.join('')}`;
  }
  throw new Error('texture has no parameter sets');
}

export class VideoTextures {
  private decoder: VideoDecoder | null = null;
  private last = 0; // the id of the picture that the decoder has; 0: none
  private count = 0;
  private waiting: { resolve(frame: VideoFrame): void; reject(error: Error): void } | null = null;

  /** Whether this browser can, here; where it has WebCodecs but not H.264, that is known when `probed`. */
  static possible = typeof VideoDecoder !== 'undefined';
  static readonly probed: Promise<void> = VideoTextures.probe();

  private static async probe(): Promise<void> {
    if (!VideoTextures.possible) return;
    const answer = await VideoDecoder.isConfigSupported({ codec: kUsualCodec }).catch(() => null);
    VideoTextures.possible = answer?.supported === true;
  }

  /**
   * The upper left `width` x `height` pixels. Throws where the section builds on a picture that was not decoded here, or
   * is damaged. One call at a time; any bytes.
   */
  async decode(section: Uint8Array, width: number, height: number): Promise<ImageBitmap> {
    if (section.length <= kHeadBytes) throw new Error('texture is cut short');
    const isKey = videoTextureIsKey(section);
    if (!isKey && (this.last === 0 || buildsOn(section) !== this.last)) {
      throw new Error('texture builds on a picture that was not received; waiting for the next key frame');
    }
    const unit = section.subarray(kHeadBytes);
    this.last = 0;
    if (isKey) await this.begin(unit);
    const picture = await this.next(unit, isKey);
    try {
      const coded = (side: number): number => Math.max(kLeastSide, side + (side % 2));
      if (picture.displayWidth !== coded(width) || picture.displayHeight !== coded(height)) {
        throw new Error('the texture is not of the size that the frame declares');
      }
      const bitmap = await createImageBitmap(picture, 0, 0, width, height, { premultiplyAlpha: 'none' });
      this.last = Math.max(1, gridId(section));
      return bitmap;
    } finally {
      picture.close();
    }
  }

  /** For good: a decoder may be a part of the card, of which there are few. */
  end(): void {
    this.waiting?.reject(new Error('nobody waits for it any more'));
    if (this.decoder !== null && this.decoder.state !== 'closed') this.decoder.close();
    this.decoder = null;
  }

  private async begin(unit: Uint8Array): Promise<void> {
    const config: VideoDecoderConfig = { codec: codecName(unit), optimizeForLatency: true };
    if (!(await VideoDecoder.isConfigSupported(config)).supported) {
      throw new Error(`this browser does not decode H.264 (${config.codec})`);
    }
    if (this.decoder === null || this.decoder.state === 'closed') {
      this.decoder = new VideoDecoder({
        output: (frame) => {
          if (this.waiting === null) frame.close();
          else this.waiting.resolve(frame);
        },
        error: (error) => this.waiting?.reject(new Error(`the texture cannot be decoded: ${error.message}`)),
      });
    }
    this.decoder.configure(config);
  }

  private async next(unit: Uint8Array, isKey: boolean): Promise<VideoFrame> {
    const decoder = this.decoder;
    if (decoder === null || decoder.state !== 'configured') throw new Error('the video decoder has stopped');
    let timer = 0;
    try {
      return await new Promise<VideoFrame>((resolve, reject) => {
        this.waiting = { resolve, reject };
        timer = self.setTimeout(() => reject(new Error('the video decoder keeps the texture back')), kPatienceMs);
        decoder.decode(
          new EncodedVideoChunk({ type: isKey ? 'key' : 'delta', timestamp: this.count++, data: unit as Uint8Array<ArrayBuffer> }),
        );
      });
    } finally {
      self.clearTimeout(timer);
      this.waiting = null;
    }
  }
}
