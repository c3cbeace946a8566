// SPDX-License-Identifier: Apache-2.0
// What became of the last frames: where their time went, and what their bytes are. Pure: every time is given, in ms.
import { kGeometryDraco, kGeometryDracoGrid, kGeometryGrid, kTextureJpeg, parseFrame } from './frame';
import type { FramePrefix } from './protocol';

export const kStages = ['server', 'gateway', 'network', 'decode', 'draw'] as const;
export type Stage = (typeof kStages)[number];
export const kParts = ['geometry', 'texture', 'quality', 'header'] as const;
export type Part = (typeof kParts)[number];

const kKept = 150;
const kPlausible_ms = 60_000; // older, a frame is from a recording

interface Entry {
  arrived: number; // UTC of this machine
  decoded: number;
}

export class Journal {
  /** Of the last frames that were drawn, the oldest first. */
  readonly stages: Record<Stage, number>[] = [];
  parts: Record<Part, number> | null = null; // bytes of the last frame
  codecs = '';
  isKey = false;
  private readonly underway = new Map<number, Entry>();

  clear(): void {
    this.stages.length = 0;
    this.underway.clear();
  }

  arrived(prefix: FramePrefix, message: ArrayBuffer, utcMs: number): void {
    if (this.underway.size > kKept) this.underway.clear();
    this.underway.set(prefix.sequence, { arrived: utcMs, decoded: utcMs });
    try {
      const frame = parseFrame(new Uint8Array(message, prefix.bytes));
      const [geometry, texture, quality] = [frame.geometry.length, frame.texture.length, frame.quality.length];
      this.parts = { geometry, texture, quality, header: message.byteLength - prefix.bytes - geometry - texture - quality };
      this.codecs = codecNames(frame.geometryCodec, frame.textureCodec);
      this.isKey = frame.isKey;
    } catch {
      // the decoder tells what is wrong with it
    }
  }

  decoded(prefix: FramePrefix, utcMs: number): void {
    const entry = this.underway.get(prefix.sequence);
    if (entry !== undefined) entry.decoded = utcMs;
  }

  /** `offset`: the server's clock less this one's. */
  shown(prefix: FramePrefix, utcMs: number, offset: number): void {
    const entry = this.underway.get(prefix.sequence);
    this.underway.delete(prefix.sequence);
    const age = utcMs + offset - prefix.captureMs;
    if (entry === undefined || !(age > 0 && age < kPlausible_ms)) return;
    this.stages.push({
      server: prefix.publishMs - prefix.captureMs,
      gateway: prefix.sentMs - prefix.publishMs,
      network: Math.max(0, entry.arrived + offset - prefix.sentMs), // as exact as the clocks are compared
      decode: entry.decoded - entry.arrived,
      draw: utcMs - entry.decoded,
    });
    if (this.stages.length > kKept) this.stages.shift();
  }

  /** Medians over the frames kept; null without any. */
  medians(): Record<Stage, number> | null {
    if (this.stages.length === 0) return null;
    const median = (stage: Stage): number => {
      const sorted = this.stages.map((s) => s[stage]).sort((a, b) => a - b);
      return sorted[Math.floor(sorted.length / 2)]!;
    };
    return Object.fromEntries(kStages.map((stage) => [stage, median(stage)])) as Record<Stage, number>;
  }
}

const kGeometry: Record<number, string> = { [kGeometryDraco]: 'Draco', [kGeometryGrid]: 'stripe grid', [kGeometryDracoGrid]: 'stripe grid in Draco' };
const kTexture: Record<number, string> = { [kTextureJpeg]: 'JPEG', 2: 'WebP', 3: 'PNG', 4: 'H.264' }; // codec/FORMAT.md

function codecNames(geometry: number, texture: number): string {
  const names = [kGeometry[geometry] ?? `geometry ${geometry}`];
  if (texture !== 0) names.push(kTexture[texture] ?? `texture ${texture}`);
  return names.join(', ');
}
