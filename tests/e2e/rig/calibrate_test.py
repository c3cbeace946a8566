#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""relievo-server calibrate with a projector and a camera together: the pictures come onto a virtual screen while a
simulated camera is watched.

usage: calibrate_test.py RELIEVO_SERVER
"""
import signal
import subprocess
import sys
import time
import unittest

import cv2
import numpy as np

from screen import ScreenTest

SERVER = sys.argv.pop(1)
WIDTH, HEIGHT = 1024, 768  # of the simulated rig's projector
PATIENCE_S = 300


class Calibrate(ScreenTest):
    COMMAND = [SERVER, "calibrate"]
    SIZE = (WIDTH, HEIGHT)

    def expect_each_on_screen(self, child, pictures):
        """In any order: the screen is looked at now and then."""
        missing = list(range(len(pictures)))
        until = time.monotonic() + PATIENCE_S
        while missing:
            now = self.screen.picture()
            missing = [i for i in missing if not np.array_equal(now, pictures[i])]
            self.assertIsNone(child.poll(), f"ended before pictures {missing} were on the screen")
            self.assertLess(time.monotonic(), until, f"pictures {missing} were never on the screen")

    def slides(self):
        out = self.folder / "slides"
        subprocess.run([SERVER, "pattern", "--both-axes", "--stripes", "40", "--size", f"{WIDTH}x{HEIGHT}", "--out", out],
                       capture_output=True, check=True)
        return [cv2.imread(str(file))[:, :, ::-1] for file in sorted(out.glob("*.png"))]

    def test_geometry_projects_both_axes_while_views_are_taken(self):
        views = self.folder / "views"
        child = self.start("geometry", views, "--source", "sim:board,period=10000,width=320,height=240,stripes=40",
                           "--project", "--views", "1000", "--board", "chessboard:9x7:25mm", "--out",
                           self.folder / "rig.yaml")
        slides = self.slides()
        self.assertEqual(len(slides), 8)
        self.expect_each_on_screen(child, slides)
        until = time.monotonic() + PATIENCE_S
        while not (views / "view_01").is_dir():
            self.assertIsNone(child.poll(), "ended early")
            self.assertLess(time.monotonic(), until, "no two views were taken")
            time.sleep(0.05)
        child.send_signal(signal.SIGINT)
        _, err = child.communicate(timeout=PATIENCE_S)
        self.assertEqual(child.returncode, 0, err)
        self.assertIn("views of this run are in", err)
        # What was seen so far: both devices' pictures side by side, the tilts below.
        coverage = cv2.imread(str(views / "coverage.png"))
        self.assertEqual(coverage.shape[:2], (720 + 150, 960 + 8 + 960))

    def test_colour_projects_the_primaries_and_writes_the_matrix(self):
        rig = self.folder / "rig.yaml"
        child = self.start("colour", self.folder / "colours", "--source", "sim:sheet,width=320,height=240", "--project",
                           "--out", rig)
        out, err = child.communicate(timeout=PATIENCE_S)
        self.assertEqual(child.returncode, 0, err)
        self.assertIn("projecting on", err)
        self.assertIn("matrix", out)
        self.assertIn("colour_matrix", rig.read_text())

    def test_an_unknown_output_fails_before_anything_is_written(self):
        child = self.start("colour", self.folder / "colours", "--source", "sim:sheet", "--project", "--projector-output",
                           "HDMI-7", "--out", self.folder / "rig.yaml")
        _, err = child.communicate(timeout=PATIENCE_S)
        self.assertEqual(child.returncode, 1)
        self.assertIn("no output HDMI-7", err)
        self.assertFalse((self.folder / "rig.yaml").exists())

    def test_the_projector_needs_a_source(self):
        child = self.start("colour", self.folder / "colours", "--project", "--out", self.folder / "rig.yaml")
        child.communicate(timeout=PATIENCE_S)
        self.assertEqual(child.returncode, 2)


if __name__ == "__main__":
    unittest.main(verbosity=2)
