# SPDX-License-Identifier: Apache-2.0
"""A virtual screen whose frame buffer can be read, and the tests of a command that draws on one."""
import os
import pathlib
import struct
import subprocess
import tempfile
import unittest

import numpy as np


class Screen:
    """An X server without a screen, on a display number of its own."""

    def __init__(self, folder, width, height):
        self.file = pathlib.Path(folder) / "Xvfb_screen0"
        read, write = os.pipe()
        self.process = subprocess.Popen(["Xvfb", "-displayfd", str(write), "-screen", "0", f"{width}x{height}x24",
                                         "-fbdir", folder, "-nolisten", "tcp"], pass_fds=[write],
                                        stderr=subprocess.DEVNULL)
        os.close(write)
        with os.fdopen(read) as numbers:
            self.number = numbers.readline().strip()  # empty where it could not start
        assert self.number, "Xvfb did not start: apt-get install xvfb"

    def environment(self):
        return {**os.environ, "DISPLAY": ":" + self.number, "LIBGL_ALWAYS_SOFTWARE": "1"}

    def picture(self):
        """The frame buffer, an XWD file: RGB."""
        data = self.file.read_bytes()
        head = struct.unpack(">25I", data[:100])
        size, colours, width, height, stride = head[0], head[19], head[4], head[5], head[12]
        little, bits = head[7] == 0, head[11]
        assert bits == 32 and little, head
        start = size + 12 * colours
        rows = np.frombuffer(data, np.uint8, height * stride, start).reshape(height, stride)
        return rows[:, :4 * width].reshape(height, width, 4)[:, :, 2::-1]

    def close(self):
        self.process.terminate()
        self.process.wait()


class ScreenTest(unittest.TestCase):
    """Runs COMMAND, a list, on a screen of SIZE with a folder of its own; no process is left behind."""
    COMMAND = []
    SIZE = (400, 300)

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.screen = Screen(folder.name, *self.SIZE)
        self.addCleanup(self.screen.close)

    def start(self, *arguments):
        child = subprocess.Popen([*self.COMMAND, *map(str, arguments)], env=self.screen.environment(),
                                 stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.addCleanup(child.stdout.close)
        self.addCleanup(child.stderr.close)
        self.addCleanup(lambda: child.poll() is None and child.kill())
        return child
