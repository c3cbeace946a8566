// SPDX-License-Identifier: Apache-2.0
// Boots a virtual machine with the kernel's test cameras, and runs guest_*_test.cpp in it. Needs QEMU, which
// scripts/setup installs; skipped where it is not.
#include <gtest/gtest.h>
#include <turbojpeg.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include "capture/reconstruct/reconstructor.h"
#include "capture/source/field_source.h"

#include "tests/support/process.h"
#include "tests/support/temp_folder.h"

namespace relievo::test {
namespace {

constexpr auto kBootPatience = std::chrono::seconds(900);

// /dev/video0 and 1: a camera, and an output whose pictures it can be given; 2: a multi-planar camera.
const char* const kVividParameters =
    "n_devs=2 node_types=0x101,0x1 multiplanar=1,2 vid_cap_nr=0,2 vid_out_nr=1,3";
const char* const kLoopbackParameters = "devices=2 video_nr=20,21 exclusive_caps=0";

Finished in_guest(const std::vector<std::string>& command, const std::filesystem::path& shared) {
  std::vector<std::string> all = {RELIEVO_SOURCE_DIR "/tests/support/vm/run",
                                  "--vivid",
                                  kVividParameters,
                                  "--loopback",
                                  kLoopbackParameters,
                                  "--share",
                                  shared.string(),
                                  "--limit",
                                  "850"};
  all.insert(all.end(), command.begin(), command.end());
  return run(all, kBootPatience);
}

/// Runs the guest's tests that `filter` names; false where they are skipped.
bool guest_tests_pass(const std::string& filter, const std::filesystem::path& shared, std::string& why) {
  const Finished done = in_guest({"env", "RELIEVO_SHARED=" + shared.string(),
                                  program("camera_guest_test").string(), "--gtest_filter=" + filter},
                                 shared);
  why = done.err;
  if (done.status == 77) return false;
  EXPECT_EQ(done.status, 0) << done.out << done.err;
  EXPECT_NE(done.out.find("[  PASSED  ]"), std::string::npos) << done.out << done.err;
  return true;
}

TEST(CameraInGuest, PicturesAndFaultsAreTheDrivers) {
  const TempFolder folder;
  std::string why;
  if (!guest_tests_pass("-Chain.*", folder.path(), why)) GTEST_SKIP() << why;
}

/// A ramp of red along x and green along y, as a JPEG without chroma subsampling.
void write_ramp(const std::filesystem::path& file) {
  Image8 ramp(64, 48, 3);
  for (int y = 0; y < ramp.height(); ++y) {
    for (int x = 0; x < ramp.width(); ++x) {
      std::uint8_t* pixel = ramp.row(y) + 3 * x;
      pixel[0] = static_cast<std::uint8_t>(4 * x);
      pixel[1] = static_cast<std::uint8_t>(5 * y);
      pixel[2] = 128;
    }
  }
  const tjhandle turbo = tjInitCompress();
  unsigned char* jpeg = nullptr;
  unsigned long size = 0;
  ASSERT_EQ(tjCompress2(turbo, ramp.data(), 64, 0, 48, TJPF_RGB, &jpeg, &size, TJSAMP_444, 100, 0), 0);
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(jpeg), static_cast<std::streamsize>(size));
  tjFree(jpeg);
  tjDestroy(turbo);
}

struct Loaded {
  SourceInfo info;
  std::vector<CapturedFrame> frames;
};

Loaded load(const std::filesystem::path& take) {
  Loaded out;
  auto source = open_source("take:" + take.string(), {});
  EXPECT_TRUE(source) << source.error().message;
  if (!source) return out;
  out.info = (*source)->info();
  for (;;) {
    auto frame = (*source)->next();
    EXPECT_TRUE(frame) << frame.error().message;
    if (!frame || !*frame) return out;
    out.frames.push_back(*std::move(*frame));
  }
}

bool same(const Image8& a, const Image8& b) {
  return a.size() == b.size() && std::equal(a.data(), a.data() + a.size(), b.data());
}

template <typename T>
bool same_bytes(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

CapturedFrame with_stamps_of(const CapturedFrame& frame, const CapturedFrame& stamped) {
  CapturedFrame out;
  out.number = stamped.number;
  out.time_ns = stamped.time_ns;
  out.scan = frame.scan;
  out.field_order = frame.field_order;
  out.picture = frame.picture.clone();
  out.complement = frame.complement.clone();
  return out;
}

/// Where both pictures are those of one rendered frame, that frame; the end otherwise.
std::vector<CapturedFrame>::const_iterator played(const Loaded& rendered, const Image8& picture,
                                                  const Image8& complement) {
  return std::find_if(rendered.frames.begin(), rendered.frames.end(), [&](const CapturedFrame& one) {
    return same(one.picture, picture) && same(one.complement, complement);
  });
}

/// True where some rendered frame has it, as either of its two pictures.
bool was_played(const Loaded& rendered, const Image8& picture) {
  return std::any_of(rendered.frames.begin(), rendered.frames.end(), [&](const CapturedFrame& one) {
    return same(one.picture, picture) || same(one.complement, picture);
  });
}

/// The output and the camera have clocks of their own: a picture may come twice or not at all, and a
/// progressive frame's two may be the second of one frame and the first of the next, for as long as nothing
/// is lost. Its pictures, two by two as they were played; those that are not beside their other one are left
/// out.
std::vector<CapturedFrame> as_played(const Loaded& rendered, const Loaded& captured) {
  const auto half_frame_ns = static_cast<std::int64_t>(0.5e9 / captured.info.rig.frame_rate);
  std::vector<CapturedFrame> out;
  std::vector<std::pair<const Image8*, std::int64_t>> pictures;
  for (const CapturedFrame& frame : captured.frames) {
    pictures.emplace_back(&frame.picture, frame.time_ns);
    pictures.emplace_back(&frame.complement, frame.time_ns + half_frame_ns);
  }
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    EXPECT_TRUE(was_played(rendered, *pictures[i].first)) << "picture " << i;
    if (i + 1 == pictures.size()) break;
    const auto found = played(rendered, *pictures[i].first, *pictures[i + 1].first);
    if (found == rendered.frames.end()) continue;
    out.push_back(found->clone());  // the same pictures
    out.back().number = i / 2;
    out.back().time_ns = pictures[i].second;
    ++i;
  }
  return out;
}

/// Each captured frame is one of the rendered, and gives the surface that the rendered one gives at that
/// time.
void expect_same_surfaces(const Loaded& rendered, Loaded captured) {
  ASSERT_GE(captured.frames.size(), 8u);
  EXPECT_EQ(captured.info.rig.scan, rendered.info.rig.scan);
  EXPECT_EQ(captured.info.rig.field_order, rendered.info.rig.field_order);
  if (captured.info.rig.scan == Scan::kProgressive) captured.frames = as_played(rendered, captured);
  Rig rig = rendered.info.rig;
  rig.frame_rate = captured.info.rig.frame_rate;  // the driver's, which has fewer digits
  auto from_camera = Reconstructor::create(captured.info.rig, captured.info.pattern, {});
  auto from_take = Reconstructor::create(rig, rendered.info.pattern, {});
  ASSERT_TRUE(from_camera && from_take);
  std::set<std::size_t> seen;
  std::size_t surfaces = 0;
  for (const CapturedFrame& frame : captured.frames) {
    const auto found = played(rendered, frame.picture, frame.complement);
    ASSERT_NE(found, rendered.frames.end()) << "frame " << frame.number << " is none of those played";
    seen.insert(static_cast<std::size_t>(found - rendered.frames.begin()));
    const auto one = from_camera->add(frame), other = from_take->add(with_stamps_of(*found, frame));
    ASSERT_TRUE(one && other);
    ASSERT_EQ(one->has_value(), other->has_value());
    if (!*one) continue;
    ++surfaces;
    const Surface &a = (*one)->surface, &b = (*other)->surface;
    EXPECT_GT(a.positions.size(), 1000u);
    EXPECT_TRUE(same_bytes(a.positions, b.positions));
    EXPECT_TRUE(same_bytes(a.normals, b.normals));
    EXPECT_TRUE(same_bytes(a.triangles, b.triangles));
    EXPECT_TRUE(same((*one)->texture, (*other)->texture));
  }
  EXPECT_GE(seen.size(), 3u);  // no still picture; how many come twice, the two clocks decide
  EXPECT_GE(surfaces, 6u);
}

TEST(CameraInGuest, TheRigsFramesThroughTheKernelGiveTheSameSurfaces) {
  const TempFolder folder;
  const auto simulate = [&](const std::string& scene, const char* name) {
    const Finished done = run({program("relievo-server").string(), "simulate", "--scene", scene, "--frames",
                               "8", "--out", (folder / name).string(), "-q"},
                              kLongPatience);
    ASSERT_EQ(done.status, 0) << done.err;
  };
  simulate("object,width=720,height=480,rate=29.97002997,field_order=bottom", "interlaced");
  simulate("object,width=320,height=240,scan=progressive,stripes=40", "progressive");
  write_ramp(folder / "ramp.jpg");
  std::string why;
  if (!guest_tests_pass("Chain.*", folder.path(), why)) GTEST_SKIP() << why;
  const Loaded interlaced = load(folder / "interlaced"), progressive = load(folder / "progressive");
  for (const auto& [rendered, captured] : {std::pair{&interlaced, "captured_interlaced"},
                                           {&interlaced, "captured_alternate"},
                                           {&progressive, "captured_progressive"}}) {
    SCOPED_TRACE(captured);
    expect_same_surfaces(*rendered, load(folder / captured));
  }
}

}  // namespace
}  // namespace relievo::test
