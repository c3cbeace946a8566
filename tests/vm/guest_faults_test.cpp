// SPDX-License-Identifier: Apache-2.0
// In the guest: the test camera's own error injection, and unplugging it.
#include <gtest/gtest.h>

#include <fstream>

#include "base/time.h"
#include "vivid.h"

namespace relievo {
namespace {

using namespace test;

/// Interlaced NTSC: a picture is a frame.
CameraOptions tv() {
  return {.input = "S-Video 0",
          .standard = "NTSC-M",
          .format = "UYVY",
          .field = "interlaced",
          .controls = still("100_black")};
}

/// The fastest small picture; two are a frame.
CameraOptions webcam() {
  return {.input = "0",
          .format = "UYVY",
          .width = 320,
          .height = 180,
          .rate = 60,
          .controls = still("100_black")};
}

void press(const std::string& button) {
  set(kVivid, {{button, "1"}});
}

TEST(Faults, DroppedBuffersAreCountedFromTheSequence) {
  const auto source = open(kVivid, tv());
  ASSERT_TRUE(source);
  const std::int64_t first_ns = next(*source).time_ns;
  set(kVivid, {{"percentage_of_dropped_buffers", "50"}});
  CapturedFrame last;
  constexpr std::uint64_t kMore = 12;
  std::uint64_t lost = 0;
  for (std::uint64_t i = 0; i < kMore; ++i) {
    last = next(*source);
    lost += last.lost_before;
  }
  set(kVivid, {{"percentage_of_dropped_buffers", "0"}});
  EXPECT_GT(lost, 0u);
  EXPECT_EQ(source->counts().lost_frames, lost);
  EXPECT_EQ(last.number, kMore + lost);
  // The camera's clock says how many there were.
  const double frames = seconds(last.time_ns - first_ns) * source->info().rig.frame_rate;
  EXPECT_NEAR(static_cast<double>(last.number), frames, 0.5);
}

TEST(Faults, DamagedBuffersAreLeftOutAndCounted) {
  const auto source = open(kVivid, tv());
  ASSERT_TRUE(source);
  next(*source);
  for (std::uint64_t damaged = 1; damaged <= 3; ++damaged) {
    press("inject_v4l2_buf_flag_error");
    for (int i = 0; i < 3; ++i) next(*source);  // whichever buffer it hit
    EXPECT_EQ(source->counts().damaged_pictures, damaged);
    EXPECT_EQ(source->counts().lost_frames, damaged);
  }
}

TEST(Faults, ADamagedHalfLosesItsFrameAlone) {
  const auto source = open(kVivid, webcam());
  ASSERT_TRUE(source);
  next(*source);
  press("inject_v4l2_buf_flag_error");
  CapturedFrame frame;
  for (int i = 0; i < 4; ++i) frame = next(*source);
  EXPECT_EQ(source->counts().damaged_pictures, 1u);
  EXPECT_EQ(source->counts().lost_frames, 1u);
  EXPECT_EQ(frame.number, 5u);
}

TEST(Faults, TheSequenceMayWrap) {
  CameraOptions options = webcam();
  options.controls.push_back({"wrap_sequence_number", "1"});  // after 128 buffers
  const auto source = open(kVivid, options);
  ASSERT_TRUE(source);
  for (std::uint64_t i = 0; i < 70; ++i) {
    const CapturedFrame frame = next(*source);
    ASSERT_EQ(frame.number, i);
  }
  EXPECT_EQ(source->counts().lost_frames, 0u);
}

TEST(Faults, StampsOfAnotherClockBecomeUtc) {
  for (const char* wrap : {"1", "2"}) {
    CameraOptions options = tv();
    options.controls.push_back({"wrap_timestamp", wrap});
    const auto source = open(kVivid, options);
    ASSERT_TRUE(source);
    std::int64_t before_ns = 0;
    for (int i = 0; i < 4; ++i) {
      const CapturedFrame frame = next(*source);
      EXPECT_NEAR(seconds(frame.time_ns), seconds(utc_now_ns()), 2);
      if (i > 0) {
        EXPECT_NEAR(static_cast<double>(frame.time_ns - before_ns) * 1e-6, 33.4, 9);
      }
      before_ns = frame.time_ns;
    }
  }
}

TEST(Faults, RefusedRequestsFailWithAMessageOnce) {
  for (const char* fault : {"inject_vidioc_reqbufs_error", "inject_vidioc_streamon_error"}) {
    press(fault);
    const auto refused = open_source("v4l2:" + kVivid, {.camera = tv()});
    ASSERT_FALSE(refused) << fault;
    EXPECT_NE(refused.error().message.find("the driver refused to"), std::string::npos)
        << refused.error().message;
    const auto source = open(kVivid, tv());
    ASSERT_TRUE(source) << fault;
    EXPECT_EQ(next(*source).number, 0u);
  }
}

TEST(Faults, ARefusedBufferIsOfferedAgain) {
  CameraOptions options = tv();
  options.buffers = 2;  // one refused for good would stop it
  const auto source = open(kVivid, options);
  ASSERT_TRUE(source);
  next(*source);
  press("inject_vidioc_qbuf_error");
  for (int i = 0; i < 6; ++i) next(*source);
  press("inject_vidioc_qbuf_error");
  for (int i = 0; i < 6; ++i) next(*source);
  EXPECT_EQ(source->counts().restarts, 0u);
}

TEST(Faults, AfterAFatalErrorStreamingStartsAgain) {
  const auto source = open(kVivid, tv());
  ASSERT_TRUE(source);
  for (int i = 0; i < 2; ++i) next(*source);
  press("inject_fatal_streaming_error");
  std::uint64_t last = 1;
  for (int i = 0; i < 6; ++i) {  // some may have been under way
    const CapturedFrame frame = next(*source);
    EXPECT_GT(frame.number, last);
    last = frame.number;
  }
  EXPECT_EQ(source->counts().restarts, 1u);
  EXPECT_EQ(source->counts().reconnects, 0u);
}

TEST(Faults, ALostSignalIsSaidOnceAndWaitedFor) {
  const auto source = open(kVivid, tv());
  ASSERT_TRUE(source);
  next(*source);
  set(kVivid, {{"standard_signal_mode", "no_signal"}});
  std::string message;
  for (int i = 0; i < 60 && message.empty(); ++i) {
    const auto frame = source->next();
    if (!frame) message = frame.error().message;
  }
  EXPECT_NE(message.find("no signal on input 2 (S-Video 0)"), std::string::npos) << message;
  set(kVivid, {{"standard_signal_mode", "current_standard"}});
  const CapturedFrame after = next(*source);  // and no second failure
  EXPECT_GT(after.lost_before, 0u);
  EXPECT_EQ(source->counts().reconnects, 0u);
}

/// Takes the camera's device away from its driver, or gives it back: /dev/video0 goes and comes.
void bind(const char* how) {
  std::ofstream file(std::string("/sys/bus/platform/drivers/vivid/") + how);
  file << "vivid.0" << std::flush;
  ASSERT_TRUE(file) << how;
}

TEST(Faults, UnpluggedAndPluggedInAgainWithoutARestart) {
  const auto source = open(kVivid, tv());
  ASSERT_TRUE(source);
  EXPECT_EQ(next(*source).number, 0u);
  press("disconnect");
  std::string message;
  std::uint64_t last = 0;
  for (int i = 0; i < 30 && message.empty(); ++i) {
    const auto frame = source->next();
    if (!frame)
      message = frame.error().message;
    else
      last = (*frame)->number;
  }
  EXPECT_NE(message.find("was unplugged"), std::string::npos) << message;
  bind("unbind");
  bind("bind");
  const CapturedFrame back = next(*source);
  EXPECT_EQ(back.number, last + 1);
  EXPECT_EQ(back.lost_before, 0u);
  EXPECT_EQ(source->counts().reconnects, 1u);
  EXPECT_EQ(back.picture.height(), 480);
}

TEST(Faults, StoppedWhileUnplugged) {
  const auto source = open(kVivid, tv());
  ASSERT_TRUE(source);
  press("disconnect");
  while (source->next()) {
  }
  source->request_stop();
  const auto end = source->next();
  ASSERT_TRUE(end);
  EXPECT_FALSE(*end);
  bind("unbind");
  bind("bind");
}

}  // namespace
}  // namespace relievo
