#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""relievo export, read by programs that share no code with it: depth by OpenCV, video by ffmpeg, GLB by hand.

usage: export_test.py RELIEVO_SERVER RELIEVO
"""
import json
import os
import pathlib
import resource
import struct
import subprocess
import sys
import tempfile
import unittest

import cv2
import numpy as np

RELIEVO = sys.argv.pop(2)
SERVER = sys.argv.pop(1)
SOURCE = "sim:object"
DOMAIN = os.environ.get("RELIEVO_TEST_DOMAIN", "228")
FRAMES = 5


def read_ply(file):
    """Positions and triangles of a PLY as relievo writes it."""
    data = file.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    header = data[:end].decode().splitlines()
    counts = {line.split()[1]: int(line.split()[2]) for line in header if line.startswith("element")}
    kinds = {"float": "<f4", "uchar": "u1"}
    fields = [(line.split()[2], kinds[line.split()[1]]) for line in header
              if line.startswith("property") and "list" not in line]
    vertices = np.frombuffer(data, np.dtype(fields), counts["vertex"], end)
    faces = np.frombuffer(data, np.dtype([("n", "u1"), ("i", "<i4", 3)]), counts["face"], end + vertices.nbytes)
    return np.stack([vertices[k] for k in "xyz"], 1).astype(float), faces["i"]


def read_glb(file):
    data = file.read_bytes()
    size, = struct.unpack_from("<I", data, 12)
    return json.loads(data[20:20 + size]), data[28 + size:]


def numbers(root, binary, accessor):
    of = root["accessors"][accessor]
    width = {"SCALAR": 1, "VEC3": 3}[of["type"]]
    at = root["bufferViews"][of["bufferView"]]["byteOffset"]
    return np.frombuffer(binary, "<f4", of["count"] * width, at).reshape(-1, width)


class Export(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        cls.path = pathlib.Path(cls.folder.name)
        for texture in ("jpeg", "h264"):
            subprocess.run([SERVER, "serve", "--source", SOURCE, "--fast", "--frames", str(FRAMES + 1), "--texture", texture,
                            "--web", "none", "--domain", DOMAIN, "-q", "--record", cls.path / f"{texture}.mcap"],
                           check=True, stdout=subprocess.DEVNULL)

    def export(self, recording, kind, out, *more):
        done = subprocess.run([RELIEVO, "export", self.path / f"{recording}.mcap", "--format", kind, "--out",
                               self.path / out, "--json", *more], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(json.loads(done.stdout)["frames"], FRAMES)
        return self.path / out

    def check_depth(self, unit_mm):
        plies = self.export("jpeg", "ply", "ply")
        depths = self.export("jpeg", "depth", f"depth{unit_mm}", "--depth-unit", str(unit_mm))
        camera = json.loads((depths / "camera.json").read_text())
        self.assertAlmostEqual(camera["depth_unit_m"], unit_mm * 1e-3)
        self.assertAlmostEqual(camera["depth_scale"] * camera["depth_unit_m"], 1)
        k = np.array([[camera["fx"], camera["skew"], camera["cx"]], [0, camera["fy"], camera["cy"]], [0, 0, 1]])
        ply = sorted(plies.glob("*.ply"))[0]
        depth = cv2.imread(str(depths / f"{ply.stem}.depth.png"), cv2.IMREAD_UNCHANGED)
        texture = cv2.imread(str(depths / f"{ply.stem}.png"))
        self.assertEqual((depth.dtype, depth.shape), (np.uint16, (camera["height"], camera["width"])))
        self.assertEqual(texture.shape, (*depth.shape, 3))
        points, triangles = read_ply(ply)

        # Rays through the centres of pixels, met with the plane of each triangle that they go through.
        rows, columns = np.nonzero(depth)
        self.assertGreater(len(rows), 10_000)
        read = depth[rows, columns] * camera["depth_unit_m"]
        at = {(r, c): i for i, (r, c) in enumerate(zip(rows, columns))}
        seen = points @ k.T
        seen = seen[:, :2] / seen[:, 2:]
        nearest = np.full(len(rows), np.inf)
        missing = 0
        for corners in triangles[:: 3 if unit_mm == 1 else 7]:
            low, high = np.ceil(seen[corners].min(0)).astype(int), np.floor(seen[corners].max(0)).astype(int)
            edges = points[corners].T
            for r in range(low[1], high[1] + 1):
                for c in range(low[0], high[0] + 1):
                    inside = np.linalg.solve(edges, np.linalg.solve(k, [c, r, 1]))  # the ray as a sum of corners
                    if inside.min() < 1e-9:
                        continue
                    i = at.get((r, c))
                    if i is None:
                        missing += 1
                    else:
                        nearest[i] = min(nearest[i], 1 / inside.sum())
        self.assertEqual(missing, 0)
        known = np.isfinite(nearest)
        self.assertGreater(known.sum(), 3000)
        # Of the triangles looked at, none is nearer than what was read; most pixels show one of them.
        error = nearest[known] - read[known]
        self.assertGreater(error.min(), -0.5 * camera["depth_unit_m"] - 1e-6)
        self.assertGreater((error < 0.5 * camera["depth_unit_m"] + 1e-6).mean(), 0.98)

    def test_every_format_has_the_frames_of_a_range(self):
        recording = self.path / "long.mcap"
        subprocess.run([SERVER, "serve", "--source", "sim:plane,width=160,height=120,stripes=30", "--frames", "31",
                        "--geometry", "grid", "--key-interval", "7", "--texture", "h264", "--web", "none",
                        "--domain", DOMAIN, "-q", "--record", recording], check=True, stdout=subprocess.DEVNULL)
        described = subprocess.run([RELIEVO, "info", recording, "--json"], capture_output=True, check=True)
        frames = json.loads(described.stdout)["frames"]
        self.assertGreater(frames, 20)
        for kind in ("ply", "obj", "glb", "animation", "depth", "png", "video"):
            written = []
            for ask in (["--frames", "9:11"], ["--to", "0.5"], ["--from", "0.5"]):
                out = self.path / f"{kind}{'-'.join(ask)}{'.mp4' if kind == 'video' else '.glb' if kind == 'animation' else ''}"
                done = subprocess.run([RELIEVO, "export", recording, "--format", kind, "--out", out, "--json", *ask],
                                      capture_output=True, text=True)
                self.assertEqual(done.returncode, 0, f"{kind} {ask}: {done.stderr}")
                written.append(json.loads(done.stdout)["frames"])
                suffix = {"ply": "*.ply", "obj": "*.obj", "glb": "*.glb", "depth": "*.depth.png", "png": "*.png"}
                if kind in suffix:
                    self.assertEqual(len(list(out.glob(suffix[kind]))), written[-1])
                elif kind == "video":
                    film, count = cv2.VideoCapture(str(out)), 0
                    while film.read()[0]:
                        count += 1
                    self.assertEqual(count, written[-1])
                else:
                    root, _ = read_glb(out)
                    self.assertEqual(len(root["nodes"]) >= written[-1], True)
            self.assertEqual(written[0], 3, kind)
            self.assertGreater(min(written[1:]), 5, kind)
            self.assertEqual(written[1] + written[2], frames, kind)

    def test_depth_reads_back_as_the_surface(self):
        self.check_depth(1)

    def test_depth_in_finer_units(self):
        self.check_depth(0.1)

    def probed(self, file):
        done = subprocess.run(["ffprobe", "-v", "error", "-of", "json", "-show_streams", "-show_packets", file],
                              capture_output=True, text=True)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        return json.loads(done.stdout)

    def check_video(self, recording, name, *more):
        file = self.export(recording, "video", name, *more)
        self.assertEqual(list(self.path.glob(f"{name}.part*")), [])
        probe = self.probed(file)
        stream, = probe["streams"]
        self.assertEqual([stream[k] for k in ("codec_name", "color_range", "color_space")], ["h264", "pc", "smpte170m"])
        self.assertEqual(len(probe["packets"]), FRAMES)
        times = [float(p["pts_time"]) for p in probe["packets"]]
        self.assertLess(max(abs(t - i / 29.97) for i, t in enumerate(times)), 0.002)
        done = subprocess.run(["ffmpeg", "-v", "error", "-xerror", "-i", file, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"],
                              capture_output=True)
        self.assertEqual((done.returncode, done.stderr), (0, b""))
        pictures = [cv2.imread(str(png))[:, :, ::-1] for png in sorted(self.export(recording, "png", recording).iterdir())]
        shown = np.frombuffer(done.stdout, np.uint8).reshape(FRAMES, *pictures[0].shape)
        for a, b in zip(shown, pictures):
            self.assertLess(np.abs(a.astype(float) - b).mean(), 4)
        return file

    def test_video_is_copied_where_it_is_one(self):
        copied = self.check_video("h264", "copied.mp4")
        again = self.check_video("h264", "again.mp4", "--reencode")
        self.assertNotEqual(copied.read_bytes(), again.read_bytes())
        mkv = self.check_video("h264", "copied.mkv")
        sizes = [[int(p["size"]) for p in self.probed(f)["packets"]] for f in (copied, mkv)]
        self.assertEqual(*sizes)

    def test_video_of_still_pictures_is_coded(self):
        self.check_video("jpeg", "coded.mp4")

    def test_two_at_once_write_whole_files_and_touch_no_other(self):
        file, notes = self.path / "both.mp4", self.path / "both.mp4.part"
        notes.write_text("mine")
        ranges = ["0:0", f"0:{FRAMES - 1}"]
        running = [subprocess.Popen([RELIEVO, "export", self.path / "jpeg.mcap", "--format", "video", "--out", file,
                                     "--frames", frames], stderr=subprocess.PIPE, text=True) for frames in ranges]
        for process in running:
            _, said = process.communicate()
            self.assertEqual(process.returncode, 0, said)
        self.assertIn(len(self.probed(file)["packets"]), [1, FRAMES])
        self.assertEqual(notes.read_text(), "mine")
        self.assertEqual(list(self.path.glob("both.mp4.part*")), [notes])

    def test_a_link_stays_one_and_what_is_no_file_is_refused(self):
        for kind, name in (("video", "a.mp4"), ("video", "a.mkv"), ("ros2", "a.mcap")):
            with self.subTest(kind), tempfile.TemporaryDirectory() as folder:
                link, new, pipe = (pathlib.Path(folder, of + name) for of in ("link-", "new-", "pipe-"))
                target = pathlib.Path(folder, "target")
                target.write_text("old")
                link.symlink_to("target")
                new.symlink_to(f"{folder}/later")
                os.mkfifo(pipe)
                for out in (link, new):
                    self.export("jpeg", kind, out)
                    self.assertTrue(out.is_symlink())
                    self.assertGreater(out.stat().st_size, 1000)
                done = subprocess.run([RELIEVO, "export", self.path / "jpeg.mcap", "--format", kind, "--out", pipe],
                                      capture_output=True, text=True)
                self.assertEqual(done.returncode, 1)
                self.assertIn(f"cannot write {pipe}: it is a pipe, not a file", done.stderr)
                self.assertNotIn("jpeg.mcap", done.stderr, "it is not the recording that fails")
                self.assertTrue(pipe.is_fifo())
                self.assertEqual(len(os.listdir(folder)), 5)

    def test_where_there_is_no_room_no_folder_is_left(self):
        def no_room():
            resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))

        recording, above = self.path / "jpeg.mcap", self.path / "full"
        kinds = ("ply", "obj", "glb", "png", "depth")
        for how in (*(("export", recording, "--format", kind) for kind in kinds), ("shot", recording)):
            done = subprocess.run([RELIEVO, *how, "--out", above / "out"], capture_output=True, text=True,
                                  preexec_fn=no_room, restore_signals=False)
            self.assertEqual(done.returncode, 1)
            self.assertIn(f"cannot write {above}/out/", done.stderr)
            self.assertFalse(above.exists(), how)

    def test_a_video_that_cannot_be_written_is_not_said_to_need_coding(self):
        file = self.path / "none" / "a.mp4"
        done = subprocess.run([RELIEVO, "export", self.path / "h264.mcap", "--format", "video", "--out", file],
                              capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn(f"error: cannot write {file}: there is no such folder", done.stderr)

    def test_a_range_between_key_frames_is_coded(self):
        file = self.path / "late.mp4"
        done = subprocess.run([RELIEVO, "export", self.path / "h264.mcap", "--format", "video", "--out", file,
                               "--frames", "2:3"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(len(self.probed(file)["packets"]), 2)

    def test_a_gap_that_mp4_cannot_hold_is_said(self):
        take, recording = self.path / "take", self.path / "days.mcap"
        subprocess.run([SERVER, "simulate", "--scene", "plane,width=192,height=144,stripes=30", "--frames", "4", "--out", take],
                       check=True, capture_output=True)
        take.joinpath("timestamps.csv").write_text("frame,time_s\n0,0\n1,0.033\n2,86400\n3,86400.033\n")
        subprocess.run([SERVER, "serve", "--source", f"take:{take}", "--fast", "--web", "none", "--domain", DOMAIN,
                        "--interface", "lo", "--record", recording], check=True, capture_output=True)
        done = {ending: subprocess.run([RELIEVO, "export", recording, "--format", "video", "--out", self.path / f"days.{ending}"],
                                       capture_output=True, text=True) for ending in ("mp4", "mkv")}
        self.assertEqual(done["mp4"].returncode, 1)
        self.assertRegex(done["mp4"].stderr, r"a gap of 23 h .* \.mkv")
        self.assertEqual(done["mkv"].returncode, 0, done["mkv"].stderr)
        self.assertEqual(sorted(f.name for f in self.path.glob("days.m*")), ["days.mcap", "days.mkv"])

    def test_other_endings_are_refused(self):
        done = subprocess.run([RELIEVO, "export", self.path / "h264.mcap", "--format", "video", "--out",
                               self.path / "a.avi"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 2)
        self.assertIn(".mp4 or .mkv", done.stderr)

    def test_animation_shows_one_frame_at_a_time(self):
        root, binary = read_glb(self.export("jpeg", "animation", "a.glb"))
        self.assertEqual(len(root["nodes"]), FRAMES)
        animation, = root["animations"]
        self.assertEqual(len(animation["channels"]), FRAMES)
        start = int(root["nodes"][0]["extras"]["time_ns"])
        for shown, node in enumerate(root["nodes"]):
            time = 1e-9 * (int(node["extras"]["time_ns"]) - start) + 1e-3
            scales = []
            for channel in animation["channels"]:
                self.assertEqual(channel["target"]["path"], "scale")
                sampler = animation["samplers"][channel["sampler"]]
                self.assertEqual(sampler["interpolation"], "STEP")
                times = numbers(root, binary, sampler["input"])[:, 0]
                self.assertTrue((np.diff(times) > 0).all())
                step = max(0, int(np.searchsorted(times, time, side="right")) - 1)
                scales.append(numbers(root, binary, sampler["output"])[step].tolist())
            self.assertEqual(scales, [[float(i == shown)] * 3 for i in range(FRAMES)])


if __name__ == "__main__":
    unittest.main(verbosity=2)
