// SPDX-License-Identifier: Apache-2.0
// Edges and corners near a place of the page, of the surfaces that are shown.
import { distortPoint } from './lens';
import type { Crop } from './pictureRim';
import type { Surface, Vec3 } from './pick';
import type { StreamInfo } from './protocol';
import { lensOf } from './rigCamera';
import { inverse, moved, turned } from './rigid';
import { snap, type Seen as SeenByCamera, type Snapped } from './snap';
import type { Hit, Seen } from './surfaces';
import type { View } from './view';

export interface Caught extends Pick<Seen, 'stream' | 'surface' | 'pose'> {
  readonly snapped: Snapped;
}

const kLack = 1.5; // times the slack: so far a mesh may end before its surface does
const kBefore = 0.015; // of the distance: what is nearer by more is another surface

type Place = Readonly<{ x: number; y: number }>;

export class Snapper {
  private readonly context = new OffscreenCanvas(1, 1).getContext('2d', { willReadFrequently: true });

  /** `described`: what is known of a stream. */
  constructor(
    private readonly view: View,
    private readonly described: (stream: string) => StreamInfo | null,
  ) {}

  /** `slack`: pixels of the page within which an edge or corner is meant; `hit`: what is there, where something is. */
  at(at: Place, slack: number, hit: Hit | null): Caught | null {
    const { navigator } = this.view;
    const ray = navigator.ray(at);
    const aside = navigator.ray({ x: at.x + slack * (1 + kLack), y: at.y });
    if (ray === null || aside === null) return null;
    const [d, e] = [ray.direction, aside.direction];
    const spread = Math.tan(Math.acos(Math.min(1, dot(d, e) / Math.sqrt(dot(d, d) * dot(e, e)))));
    for (const seen of this.view.seen) {
      const { stream, surface, pose } = seen;
      const back = inverse(pose);
      const [origin, direction] = [moved(back, ray.origin), turned(back, ray.direction)];
      const own = hit !== null && hit.stream === stream ? hit : null;
      const toPage = (point: Vec3): Place | null => navigator.toPage(moved(pose, point));
      for (const focus of [nearer(surface, origin, direction, spread, own?.along ?? null), own?.point ?? null]) {
        if (focus === null || !(focus[2] > 0)) continue;
        const snapped = snap(surface, focus, { at, origin, direction, slack, toPage }, this.seenOf(seen));
        if (snapped !== null) return { snapped, stream, surface, pose };
      }
    }
    return null;
  }

  private seenOf({ stream, picture }: Seen): SeenByCamera | null {
    const info = this.described(stream);
    if (info === null) return null;
    const { camera, projector, projector_from_camera_rotation: rotation, projector_from_camera_translation: t, stripes } = info;
    const light =
      projector === undefined || rotation?.length !== 9 || t?.length !== 3
        ? null
        : { projector, stripes, projectorFromCamera: { rotation, translation: t as Vec3 } };
    const lens = lensOf(camera);
    return {
      camera,
      light,
      crop: (centre, reach) => {
        const { context } = this;
        if (picture === null || picture.width === 0 || context === null) return null;
        const scale = picture.width / camera.width; // a lower quality has a smaller one
        const place = (u: number, v: number): [number, number] => {
          const [x, y, z] = distortPoint(lens, [u, v, 1]);
          return [scale * ((x / z) * camera.fx + camera.cx + 0.5) - 0.5, scale * ((y / z) * camera.fy + camera.cy + 0.5) - 0.5];
        };
        return cropOf(context, picture, place, centre, reach);
      },
    };
  }
}

function cropOf(context: OffscreenCanvasRenderingContext2D, picture: ImageBitmap, place: Crop['place'], [u, v]: readonly [number, number], reach: number): Crop | null {
  const corners = [-reach, reach].flatMap((du) => [-reach, reach].map((dv) => place(u + du, v + dv)));
  const [xs, ys] = [corners.map(([x]) => x), corners.map(([, y]) => y)];
  const [x, y] = [Math.max(0, Math.floor(Math.min(...xs))), Math.max(0, Math.floor(Math.min(...ys)))];
  const width = Math.min(picture.width, Math.ceil(Math.max(...xs))) - x;
  const height = Math.min(picture.height, Math.ceil(Math.max(...ys))) - y;
  if (!(width > 1 && height > 1)) return null;
  const { canvas } = context;
  if (canvas.width < width || canvas.height < height) [canvas.width, canvas.height] = [Math.max(canvas.width, width), Math.max(canvas.height, height)];
  context.drawImage(picture, x, y, width, height, 0, 0, width, height);
  return { x, y, width, height, rgba: context.getImageData(0, 0, width, height).data, place };
}

const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** Of vertices within a tangent of the ray and well before what it meets, that nearest to it. */
function nearer({ positions: p }: Surface, origin: Vec3, direction: Vec3, spread: number, met: number | null): Vec3 | null {
  const size2 = dot(direction, direction);
  let [best, at] = [Infinity, -1];
  let first = met === null ? Infinity : met * (1 - kBefore); // no vertex behind this
  for (const pass of met === null ? [0, 1] : [1]) {
    for (let i = 0; i < p.length; i += 3) {
      const [x, y, z] = [p[i]! - origin[0], p[i + 1]! - origin[1], p[i + 2]! - origin[2]];
      const along = (x * direction[0] + y * direction[1] + z * direction[2]) / size2;
      if (!(along > 0) || along > first) continue;
      const off2 = (x * x + y * y + z * z) / size2 - along * along;
      const share = off2 / (along * along * spread * spread);
      if (share > 1) continue;
      if (pass === 0) first = Math.min(first, along);
      else if (share < best) [best, at] = [share, i];
    }
    if (pass === 0) first *= 1 + kBefore;
  }
  return at < 0 ? null : [p[at]!, p[at + 1]!, p[at + 2]!];
}
