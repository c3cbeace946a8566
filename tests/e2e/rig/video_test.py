#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""relievo-server pattern --out FILE.mkv, decoded by ffmpeg: every pixel, every frame, flags and rate.

usage: video_test.py RELIEVO_SERVER
"""
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import cv2
import numpy as np

SERVER = sys.argv.pop(1)
WIDTH, HEIGHT = 320, 48


def run(*arguments):
    return subprocess.run([SERVER, "pattern", *map(str, arguments)], capture_output=True, text=True)


class Video(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.path = pathlib.Path(self.folder.name)

    def decoded(self, file):
        done = subprocess.run(["ffmpeg", "-v", "error", "-xerror", "-i", file, "-f", "rawvideo", "-pix_fmt", "rgb24",
                               "-"], capture_output=True)
        self.assertEqual((done.returncode, done.stderr), (0, b""))
        return np.frombuffer(done.stdout, np.uint8).reshape(-1, HEIGHT, WIDTH, 3)

    def probed(self, file):
        done = subprocess.run(["ffprobe", "-v", "error", "-of", "json", "-show_streams", "-show_frames", file],
                              capture_output=True, text=True)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        return json.loads(done.stdout)

    def check(self, options, seconds, rate, field_order):
        slides = self.path / "slides"
        pictures = json.loads(run("--out", slides, "--size", f"{WIDTH}x{HEIGHT}", "--json", *options).stdout)
        cycle = [cv2.imread(str(slides / name))[:, :, ::-1] for name in pictures["order"]]
        file = self.path / "slides.mkv"
        done = run("--out", file, "--size", f"{WIDTH}x{HEIGHT}", "--seconds", seconds, "--json", *options)
        self.assertEqual(done.returncode, 0, done.stderr)
        said = json.loads(done.stdout)
        frames = self.decoded(file)
        self.assertEqual(len(frames), said["pictures"])
        self.assertGreaterEqual(len(frames) / rate, seconds - 1e-6)
        self.assertLess(len(frames) - len(cycle), seconds * rate)  # rounded up to whole cycles and no more
        self.assertEqual(len(frames) % len(cycle), 0)
        for i, frame in enumerate(frames):
            self.assertTrue(np.array_equal(frame, cycle[i % len(cycle)]), f"frame {i}")
        probe = self.probed(file)
        stream, = probe["streams"]
        self.assertEqual(stream["codec_name"], "ffv1")
        self.assertEqual(stream["field_order"], field_order)
        num, den = map(int, stream["r_frame_rate"].split("/"))
        self.assertAlmostEqual(num / den, rate, places=3)
        for i, frame in enumerate(probe["frames"]):
            self.assertAlmostEqual(float(frame["pts_time"]), i / rate, delta=0.0011)  # Matroska's milliseconds
        self.assertEqual((self.path / "slides.pattern.yaml").read_text(), (slides / "pattern.yaml").read_text())
        self.assertEqual(sorted(p.name for p in self.path.iterdir()), ["slides", "slides.mkv", "slides.pattern.yaml"])

    def test_fields(self):
        self.check([], 0.5, 2 * 30000 / 1001, "progressive")

    def test_top_field_first(self):
        self.check(["--interlaced"], 0.4, 30000 / 1001, "tt")

    def test_bottom_field_first(self):
        self.check(["--interlaced", "--field-order", "bottom", "--rate", "25"], 0.4, 25, "bb")

    def test_schemes(self):
        self.check(["--scheme", "white-frame"], 0.2, 2 * 30000 / 1001, "progressive")

    def test_refusals(self):
        done = run("--out", self.path / "none" / "a.mkv")
        self.assertEqual(done.returncode, 1)
        self.assertIn(f"cannot write {self.path}/none/a.mkv: there is no such folder", done.stderr)
        self.assertEqual(run("--out", self.path / "a.mkv", "--gray").returncode, 2)
        self.assertEqual(list(self.path.iterdir()), [])

    def test_a_link_stays_one_and_a_pipe_is_refused(self):
        link, pipe = self.path / "link.mkv", self.path / "pipe.mkv"
        link.symlink_to("slides.mkv")
        os.mkfifo(pipe)
        self.assertEqual(run("--out", link, "--seconds", 0.1).returncode, 0)
        self.assertTrue(link.is_symlink() and link.stat().st_size > 1000)
        done = run("--out", pipe)
        self.assertEqual(done.returncode, 1)
        self.assertIn("it is a pipe, not a file", done.stderr)
        self.assertTrue(pipe.is_fifo())

    def test_interrupted_leaves_nothing(self):
        child = subprocess.Popen([SERVER, "pattern", "--out", self.path / "long.mkv", "--seconds", "36000"])
        while child.poll() is None and not any(p.name.startswith("long.mkv.part") for p in self.path.iterdir()):
            time.sleep(0.01)
        child.send_signal(signal.SIGINT)
        self.assertEqual(child.wait(60), 0)
        self.assertEqual(list(self.path.iterdir()), [])


if __name__ == "__main__":
    unittest.main(verbosity=2)
