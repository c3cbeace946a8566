// SPDX-License-Identifier: Apache-2.0
// Proves: what is looked at lies in the middle of what panels and the page's parts leave free, and is where it is drawn.
import * as THREE from 'three';
import { afterAll, beforeAll, describe, expect, it, vi } from 'vitest';
import { freeOf, kNoInsets, viewOffset, withPanel, type Box, type Insets } from '../src/insets';
import { Navigator } from '../src/navigator';

const picture: Box = { left: 0, top: 0, right: 1100, bottom: 680 };
const size = { width: 1100, height: 680 };
const parts: Insets = { top: 60, right: 58, bottom: 140, left: 0 };

describe('withPanel', () => {
  it('takes a panel off the side where it lies', () => {
    const panel = { left: 718, top: 58, right: 1034, bottom: 520 };
    expect(withPanel(parts, picture, panel)).toEqual({ ...parts, right: 382 });
    expect(withPanel(parts, picture, { ...panel, left: 14, right: 330 })).toEqual({ ...parts, left: 330 });
  });
  it('counts from the sides of the picture, wherever that is', () => {
    const half = { ...picture, left: 300, right: 900 };
    expect(withPanel(kNoInsets, half, { left: 700, top: 0, right: 1000, bottom: 680 })).toEqual({ ...kNoInsets, right: 200 });
    expect(withPanel(parts, half, { left: 950, top: 0, right: 1050, bottom: 680 })).toEqual(parts); // beside it
  });
  it('leaves out one that covers more than about half of the width', () => {
    const phone = { left: 0, top: 0, right: 390, bottom: 780 };
    expect(withPanel(parts, phone, { left: 14, top: 300, right: 376, bottom: 766 })).toBe(parts);
    expect(withPanel(parts, { ...picture, right: 660 }, { left: 280, top: 58, right: 600, bottom: 520 })).toBe(parts);
  });
});

describe('freeOf', () => {
  it('is what lies between them', () => {
    expect(freeOf(size, parts)).toEqual({ x: 521, y: 300, width: 1042, height: 480 });
  });
  it('is all where they leave too little', () => {
    expect(freeOf({ width: 100, height: 680 }, { ...parts, right: 70 })).toMatchObject({ x: 50, width: 100, y: 300 });
  });
});

it('the axis of the view goes through the middle, without turning or zooming', () => {
  const at = new THREE.Vector3(0.3, 0.2, -2);
  const seen = [kNoInsets, { ...parts, right: 382 }].map((insets) => {
    const camera = new THREE.PerspectiveCamera(40, size.width / size.height);
    camera.setViewOffset(...viewOffset(size, insets));
    const { x, y } = freeOf(size, insets);
    const page = (point: THREE.Vector3): number[] => {
      const { x, y } = point.clone().project(camera);
      return [((x + 1) / 2) * size.width, ((1 - y) / 2) * size.height];
    };
    const [middle, aside] = [page(new THREE.Vector3(0, 0, -1)), page(at)];
    expect(middle[0]).toBeCloseTo(x, 9);
    expect(middle[1]).toBeCloseTo(y, 9);
    return aside.map((c, i) => c - middle[i]!);
  });
  for (const i of [0, 1]) expect(seen[1]![i]).toBeCloseTo(seen[0]![i]!, 9);
});

describe('a panel', () => {
  beforeAll(() => void vi.stubGlobal('window', Object.assign(new EventTarget(), { matchMedia: () => ({ matches: false }) })));
  afterAll(() => void vi.unstubAllGlobals());
  const canvas = { addEventListener() {}, removeEventListener() {}, style: {}, getRootNode: () => canvas, ownerDocument: null } as unknown as HTMLCanvasElement;
  const rig = { width: 640, height: 480, fx: 800, fy: 800, cx: 320, cy: 240 };
  const beside = { ...parts, right: 382 };
  function navigator(): Navigator {
    const made = new Navigator(canvas, { changed: () => undefined, way: () => undefined }, new EventTarget());
    made.restart(rig, false);
    made.resize(size);
    made.setInsets(parts, parts);
    made.setExtent({ min: [-0.2, -0.3, 0.9], max: [0.3, 0.3, 1.2], centre: [0.05, 0, 1], depths: [0.9, 1.2] });
    return made;
  }
  const targetOf = ({ pose: { target: [x, y, z] } }: Navigator): [number, number, number] => [x, -y, -z];

  it('moves what is turned around into the middle of the rest, and back', () => {
    const of = navigator();
    of.orbit(0.2, 0.1); // by hand: the eye stays
    of.camera.updateMatrixWorld(); // as before a drawing
    const { pose } = of;
    const before = of.toPage(targetOf(of))!;
    of.setInsets(parts, beside);
    const { x, y } = freeOf(size, beside);
    expect(of.toPage(targetOf(of))).toEqual({ x: expect.closeTo(x, 6), y: expect.closeTo(y, 6) });
    expect(of.pose).toEqual(pose);
    of.setInsets(parts, parts);
    expect(of.toPage(targetOf(of))).toEqual({ x: expect.closeTo(before.x, 6), y: expect.closeTo(before.y, 6) });
  });

  it('leaves each place where its ray goes', () => {
    const of = navigator();
    of.setInsets(parts, beside);
    of.camera.updateMatrixWorld();
    const point: [number, number, number] = [0.1, -0.12, 1.05];
    const { origin, direction } = of.ray(of.toPage(point)!)!;
    const along = (point[2] - origin[2]) / direction[2];
    for (const i of [0, 1]) expect(origin[i]! + along * direction[i]!).toBeCloseTo(point[i]!, 9);
  });

  it('leaves a picture what was seen without it, also where the parts have grown by a line since', () => {
    const of = navigator();
    of.orbit(0.2, 0.1);
    const before = of.camera.projectionMatrix.toArray();
    const grown = { ...parts, bottom: parts.bottom + 20 };
    of.setInsets(grown, grown);
    expect(of.camera.projectionMatrix.toArray()).toEqual(before); // the view does not follow so little
    of.setInsets(grown, { ...grown, right: beside.right });
    expect(of.bareProjection).toEqual(before);
  });

  it("leaves the picture of the rig's camera whole, where its rays are, and as it was to a picture", () => {
    const of = navigator();
    expect(of.picture).toBeNull();
    of.way = 'camera';
    of.camera.updateMatrixWorld();
    const before = of.camera.projectionMatrix.toArray();
    of.setInsets(parts, beside);
    const { x, y, width, height } = of.picture!;
    expect(width / height).toBeCloseTo(640 / 480, 9);
    expect(x).toBeGreaterThanOrEqual(0);
    expect(x + width).toBeLessThanOrEqual(size.width - beside.right + 1e-9);
    expect(y).toBeGreaterThanOrEqual(beside.top - 1e-9);
    expect(y + height).toBeLessThanOrEqual(size.height - beside.bottom + 1e-9);
    expect(of.middle).toMatchObject({ x: expect.closeTo(x + width / 2, 9), y: expect.closeTo(y + height / 2, 9) });
    const point: [number, number, number] = [0.1, -0.12, 1.05];
    const at = of.toPage(point)!;
    expect(at.x).toBeCloseTo(x + ((320 + (800 * point[0]) / point[2] + 0.5) / 640) * width, 6);
    const { direction } = of.ray(at)!;
    expect(direction[0] / direction[2]).toBeCloseTo(point[0] / point[2], 6);
    expect(of.camera.projectionMatrix.toArray()).not.toEqual(before);
    expect(of.bareProjection).toEqual(before);
  });

  it('is no part of what is taken away: neither of a picture nor, opened or closed meanwhile, of a video', () => {
    const of = navigator();
    of.orbit(0.2, 0.1);
    const before = of.camera.projectionMatrix.toArray();
    of.setInsets(parts, beside);
    expect(of.bareProjection).toEqual(before);
    expect(of.camera.projectionMatrix.toArray()).not.toEqual(before);
    of.ignoresPanels = true;
    expect(of.camera.projectionMatrix.toArray()).toEqual(before);
    of.setInsets(parts, parts);
    of.setInsets(parts, beside);
    expect(of.camera.projectionMatrix.toArray()).toEqual(before);
    of.ignoresPanels = false;
    expect(of.camera.projectionMatrix.toArray()).not.toEqual(before);
  });
});
