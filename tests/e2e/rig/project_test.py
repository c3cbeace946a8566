#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""relievo-server project on a virtual screen (Xvfb, Mesa's software OpenGL), whose frame buffer is read as the X
server keeps it: what is on the screen is what `pattern` writes, pixel by pixel.

usage: project_test.py RELIEVO_SERVER
"""
import json
import os
import signal
import subprocess
import sys
import time
import unittest

import cv2
import numpy as np

from screen import ScreenTest

SERVER = sys.argv.pop(1)
WIDTH, HEIGHT = 400, 300
PATIENCE_S = 120


class Project(ScreenTest):
    COMMAND = [SERVER, "project"]
    SIZE = (WIDTH, HEIGHT)

    def run_to_end(self, *arguments):
        child = self.start(*arguments)
        out, err = child.communicate(timeout=PATIENCE_S)
        return child.returncode, out, err

    def slides(self, *options):
        folder = self.folder / "-".join(["slides", *options])
        done = subprocess.run([SERVER, "pattern", "--out", folder, "--size", f"{WIDTH}x{HEIGHT}", "--json", *options],
                              capture_output=True, text=True, check=True)
        return [cv2.imread(str(folder / name))[:, :, ::-1] for name in json.loads(done.stdout)["order"]]

    def expect_on_screen(self, child, picture):
        until = time.monotonic() + PATIENCE_S
        while not np.array_equal(self.screen.picture(), picture):
            self.assertIsNone(child.poll(), "ended early")
            self.assertLess(time.monotonic(), until, "never on the screen")

    def interrupt(self, child):
        child.send_signal(signal.SIGINT)
        out, err = child.communicate(timeout=PATIENCE_S)
        self.assertEqual(child.returncode, 0, err)
        return out

    def test_lists_outputs(self):
        code, out, err = self.run_to_end("--list", "--json")
        self.assertEqual(code, 0, err)
        output, = json.loads(out)
        self.assertEqual((output["mode"]["width"], output["mode"]["height"]), (WIDTH, HEIGHT))
        self.assertTrue(output["primary"])

    def test_stills_are_exact(self):
        first, complement = self.slides()[:2]
        for name, picture in (("slide1", first), ("slide1_complement", complement),
                              ("white", np.full((HEIGHT, WIDTH, 3), 255, np.uint8)),
                              ("black", np.zeros((HEIGHT, WIDTH, 3), np.uint8))):
            child = self.start("--still", name, "--json")
            self.assertIn("projecting on", child.stderr.readline())
            self.expect_on_screen(child, picture)
            report = json.loads(self.interrupt(child))
            self.assertEqual((report["still"], report["width"], report["height"]), (name, WIDTH, HEIGHT))

    def test_every_slide_is_exact_and_in_turn(self):
        for options in ([], ["--interlaced"], ["--scheme", "white-field"]):
            child = self.start("--json", *options)
            for picture in self.slides(*options):
                self.expect_on_screen(child, picture)
            report = json.loads(self.interrupt(child))
            self.assertGreater(report["pictures"], 0)
            self.assertEqual((report["width"], report["height"]), (WIDTH, HEIGHT))

    def test_counts_pictures(self):
        code, out, err = self.run_to_end("--pictures", "40", "--json")
        self.assertEqual(code, 0, err)
        report = json.loads(out)
        self.assertEqual(report["pictures"], 40)
        # Each picture but the first takes a refresh, and each missed one another.
        self.assertEqual(report["refreshes"], 39 + report["missed"])
        # This screen has no refresh to wait for; where that was noticed, the program says so.
        self.assertEqual("does not wait for its refresh" in err, not report["synchronised"])

    def test_refusals(self):
        rig = self.folder / "rig.yaml"
        subprocess.run([SERVER, "simulate", "--scene", "plane,width=64,height=48", "--frames", "2", "--out",
                        self.folder / "take"], capture_output=True, check=True)
        rig.write_text((self.folder / "take" / "rig.yaml").read_text())
        for arguments, text in ((["--rig", rig], "has no mode 1024x768"), (["--output", "HDMI-7"], "no output HDMI-7"),
                                (["--stripes", "500"], "do not fit")):
            code, out, err = self.run_to_end(*arguments)
            self.assertEqual((code, out), (1, ""), err)
            self.assertIn(text, err)
            self.assertEqual(len([line for line in err.splitlines() if "projecting on" not in line]), 1, err)

    def test_wrong_usage_opens_no_window(self):
        for arguments, text in ((["--still", "slide9"], "no picture slide9"), (["--base", "7"], "a base of 3 to 6"),
                                (["--still", "white", "--pictures", "3"], "--pictures excludes --still"),
                                (["--cycle", "colours", "--still", "white"], "--cycle excludes --still")):
            code, out, err = self.run_to_end(*arguments)
            self.assertEqual((code, out, len(err.splitlines())), (2, "", 1), err)
            self.assertIn(text, err)

    def test_no_desktop(self):
        environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
        done = subprocess.run([SERVER, "project"], env=environment, capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn("there is no desktop", done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
