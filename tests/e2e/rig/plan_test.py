#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""relievo-server plan against formulas written down a second time, and against a simulated rig's measured errors.

usage: plan_test.py RELIEVO_SERVER
"""
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import unittest

import cv2
import numpy as np

SERVER = sys.argv.pop(1)


def run(*arguments):
    return subprocess.run([SERVER, *map(str, arguments)], capture_output=True, text=True)


def plan(*arguments):
    done = run("plan", *arguments, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def projector_columns(camera_column, depth, rig):
    """Where a point on the middle row is lit: the projector stands `b` to the right and turns in."""
    angle = math.atan2(rig["b"], rig["d"])
    x = (camera_column - (rig["cw"] - 1) / 2) / rig["cf"] * depth - rig["b"]
    along, across = x * -math.sin(angle) + depth * math.cos(angle), x * math.cos(angle) + depth * math.sin(angle)
    return rig["pf"] * across / along + (rig["pw"] - 1) / 2


class Formulas(unittest.TestCase):
    CASES = [
        # options, camera w h f, projector w f, baseline, distance, near, far, stripes, scan, rate
        (["--camera", "640x480", "--camera-fov", "34", "--projector", "1024x768", "--throw", "1.46"],
         dict(cw=640, ch=480, cf=320 / math.tan(math.radians(17)), pw=1024, pf=1024 * 1.46, b=0.2, d=1, near=0.8,
              far=1.25, n=90, interlaced=True, rate=29.97)),
        (["--camera", "1920x1080", "--lens-mm", "16", "--sensor-mm", "11.3", "--projector", "1920x1080",
          "--projector-fov", "40", "--scan", "progressive", "--rate", "60", "--baseline", "0.35", "--distance", "1.8",
          "--near", "1.5", "--far", "2.2", "--stripes", "240", "--speed", "0.5", "--exposure-ms", "4",
          "--camera-aperture-mm", "4", "--projector-aperture-mm", "10", "--noise", "2", "--level", "120"],
         dict(cw=1920, ch=1080, cf=1920 * 16 / 11.3, pw=1920, pf=960 / math.tan(math.radians(20)), b=0.35, d=1.8,
              near=1.5, far=2.2, n=240, interlaced=False, rate=60, speed=0.5, exposure=0.004, ca=0.004, pa=0.010,
              noise=2, level=120)),
    ]

    def test_table(self):
        for options, rig in self.CASES:
            out = plan(*options)
            self.assertAlmostEqual(out["camera_focal_px"], rig["cf"], places=6)
            self.assertAlmostEqual(out["projector_focal_px"], rig["pf"], places=6)
            for name, depth in (("near", rig["near"]), ("distance", rig["d"]), ("far", rig["far"])):
                with self.subTest(case=options, depth=name):
                    self.check(out[name], depth, rig)

    def check(self, at, depth, rig):
        self.assertAlmostEqual(at["depth_m"], depth)
        self.assertAlmostEqual(at["view_width_m"], depth * rig["cw"] / rig["cf"])
        self.assertAlmostEqual(at["view_height_m"], depth * rig["ch"] / rig["cf"])
        columns = np.linspace(0, rig["cw"] - 1, 2001)
        lit = np.array([projector_columns(c, depth, rig) for c in columns])
        inside = (lit >= -0.5) & (lit <= rig["pw"] - 0.5)
        step = np.abs(np.gradient(lit, columns))[inside]
        per_px = np.median(step)
        self.assertAlmostEqual(at["stripe_px"], rig["pw"] / rig["n"] / per_px, delta=0.01 * at["stripe_px"])
        self.assertAlmostEqual(at["stripe_m"], at["stripe_px"] * depth / rig["cf"])
        # Depth a pixel, numerically: the middle pixel's projector column as a function of depth, over the column's
        # function of the camera's.
        middle, h = (rig["cw"] - 1) / 2, 1e-5
        by_depth = (projector_columns(middle, depth + h, rig) - projector_columns(middle, depth - h, rig)) / (2 * h)
        # On the light sheet u(x, z) = const along which x moves a pixel; z of a plane through the point.
        by_pixel = (projector_columns(middle + h, depth, rig) - projector_columns(middle - h, depth, rig)) / (2 * h)
        self.assertAlmostEqual(at["metres_per_px"], abs(by_pixel / by_depth), delta=1e-3 * at["metres_per_px"])

        field = 0.5 / rig["rate"]
        exposure, speed = rig.get("exposure", field), rig.get("speed", 0)
        self.assertAlmostEqual(at["motion_blur_px"], rig["cf"] * speed * exposure / depth)
        self.assertAlmostEqual(at["motion_frame_px"], speed / rig["rate"] / at["metres_per_px"])
        confusion = abs(1 / rig["d"] - 1 / depth) / 4
        focus = math.hypot(rig["cf"] * rig.get("ca", 0) * confusion, rig["pf"] * rig.get("pa", 0) * confusion / per_px)
        self.assertAlmostEqual(at["focus_blur_px"], focus, delta=0.01 * focus + 1e-9)
        smear = speed * exposure / at["metres_per_px"]
        blur = math.sqrt(1 + 1 / 12 + smear ** 2 / 12 + focus ** 2 + (0.7 / per_px) ** 2)
        self.assertAlmostEqual(at["blur_px"], blur, delta=0.01 * blur)
        # The bound from its definition, summed over samples of the edge: noise over the root of the slopes' squares.
        noise = rig.get("noise", 1.2) * math.sqrt(1.5 if rig["interlaced"] else 2)
        x = np.arange(-30, 30, 0.01)
        edge = 2 * rig.get("level", 180) * np.exp(-x ** 2 / (2 * blur ** 2)) / (math.sqrt(2 * math.pi) * blur)
        bound = noise / math.sqrt(1.8 * np.sum(edge ** 2) * 0.01)
        self.assertAlmostEqual(at["bound_px"], bound, delta=0.02 * bound)
        self.assertAlmostEqual(at["sigma_m"], at["sigma_px"] * at["metres_per_px"])

    def test_lit_and_recommended(self):
        narrow = plan("--throw", "3")
        self.assertLess(narrow["distance"]["lit"], 0.5)
        self.assertTrue(any("lights only" in w for w in narrow["warnings"]))
        self.assertEqual(plan()["warnings"], [])
        many = plan("--stripes", "200")
        self.assertTrue(any("camera pixels wide" in w for w in many["warnings"]))
        n = many["recommended_stripes"]
        self.assertGreaterEqual(plan("--stripes", n)["far"]["stripe_px"], 5)
        self.assertLess(plan("--stripes", int(n * 1.15))["far"]["stripe_px"], 5)
        self.assertEqual(plan("--stripes", n)["warnings"], [])

    def test_ambiguity_of_one_slide(self):
        out = plan("--stripes", "90")
        self.assertTrue(out["codes_unique"])
        span = out["one_slide_one_boundary"]
        self.assertLess(span["near_m"], 1)
        self.assertGreater(span["far_m"], 1)
        # The boundary seen by the middle pixel at one end of the span has the colours of the one at the distance:
        # they are a whole number of stripes apart, and some pair in the pattern is.
        rig = self.CASES[0][1]
        middle = (rig["cw"] - 1) / 2
        here, there = (projector_columns(middle, z, rig) for z in (1, span["near_m"]))
        apart = abs(there - here) * 90 / 1024
        self.assertAlmostEqual(apart, round(apart), places=3)
        with tempfile.TemporaryDirectory() as folder:
            self.assertEqual(run("pattern", "--out", folder, "--size", "90x8").returncode, 0)
            repeats = []
            for slide in ("slide1", "slide2"):
                row = [tuple(p) for p in cv2.imread(f"{folder}/{slide}.png")[0].tolist()]
                pairs = list(zip(row, row[1:]))
                repeats += [j - i for i in range(len(pairs)) for j in range(i + 1, len(pairs)) if pairs[i] == pairs[j]]
            self.assertEqual(round(apart), min(repeats))

    def test_more_slides_than_are_decoded(self):
        self.assertEqual(run("plan", "--slides", "3").returncode, 2)
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "pattern.yaml"
            file.write_text('%YAML:1.0\n---\nbase: 6\nslides: 3\nsequence: [ 0, 43, 86 ]\n'
                            'palette: [ "100", "010", "001", "011", "101", "110" ]\n')
            done = run("plan", "--pattern", file)
            self.assertEqual(done.returncode, 1)
            self.assertIn("one or two", done.stderr)

    def test_refusals(self):
        for status, arguments, text in ((1, ["--near", "2"], "in order"), (1, ["--near", "0.05"], "no view in common"),
                                        (2, ["--stripes", "2000"], "stripes")):
            done = run("plan", *arguments)
            self.assertEqual(done.returncode, status, done.stdout)
            self.assertEqual(len(done.stderr.splitlines()), 1)
            self.assertIn(text, done.stderr)
        self.assertEqual(run("plan", "--lens-mm", "8").returncode, 2)


class Measured(unittest.TestCase):
    """The expected standard deviation is within a factor of two of a simulated rig's."""

    def test_sigma(self):
        for scene, noise, camera_blur in (("plane,scan=progressive,chroma=0,crosstalk=0,noise=8", 8, 0),
                                          ("plane,noise=8,stripes=60", 8, 1), ("plane,noise=3,stripes=120", 3, 1),
                                          ("plane", 1.2, 1)):
            with self.subTest(scene=scene), tempfile.TemporaryDirectory() as folder:
                take = pathlib.Path(folder) / "take"
                self.assertEqual(run("simulate", "--scene", scene, "--frames", 4, "--out", take).returncode, 0)
                score = json.loads(run("evaluate", take, "--json").stdout)
                # As on a real rig, the level is read off pictures under a slide and its complement.
                if "progressive" in scene:
                    a, b = (cv2.imread(str(take / f"frames/00000{i}.png")).astype(float) for i in (2, 3))
                else:
                    picture = cv2.imread(str(take / "frames/000002.png")).astype(float)
                    a, b = picture[0::2], picture[1::2]
                level = float(np.median(np.abs(a - b).max(axis=2)))
                out = plan("--rig", take / "rig.yaml", "--pattern", take / "pattern.yaml", "--level", level, "--noise",
                           noise, "--camera-blur", camera_blur)
                ratio = score["rms_um_per_m"] * 1e-6 / out["distance"]["sigma_m"]
                print(f"{scene}: measured over expected {ratio:.2f}")
                self.assertTrue(0.5 < ratio < 2, ratio)


if __name__ == "__main__":
    unittest.main(verbosity=2)
