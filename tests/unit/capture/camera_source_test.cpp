// SPDX-License-Identifier: Apache-2.0
// The camera source against a scripted driver: order, loss and faults. What real drivers do: tests/vm.
#include "capture/source/v4l2/camera_source.h"

#include <gtest/gtest.h>

#include <climits>
#include <fstream>

#include "capture/source/v4l2/driver_clock.h"
#include "fake_camera.h"
#include "tests/support/striped_scene.h"
#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

using test::FakeCamera;

std::unique_ptr<FieldSource> open(FakeCamera& camera, const CameraOptions& options = {}) {
  auto source = v4l2::open_camera(camera, "/dev/video0", options);
  EXPECT_TRUE(source) << source.error().message;
  return source ? *std::move(source) : nullptr;
}

CapturedFrame next(FieldSource& source) {
  auto frame = source.next();
  if (!frame || !*frame) {
    ADD_FAILURE() << (frame ? "ended" : frame.error().message);
    return {};
  }
  return *std::move(*frame);
}

std::string failure(FieldSource& source) {
  const auto frame = source.next();
  return frame ? "" : frame.error().message;
}

std::string refusal(FakeCamera& camera, const CameraOptions& options = {}) {
  const auto source = v4l2::open_camera(camera, "/dev/video0", options);
  EXPECT_FALSE(source);
  EXPECT_EQ(camera.opened, 0);
  EXPECT_EQ(camera.mapped, 0);
  return source ? "" : source.error().message;
}

#define EXPECT_SAYS(message, words) EXPECT_NE((message).find(words), std::string::npos) << (message)

TEST(CameraSource, PairsPicturesByTheSequence) {
  FakeCamera camera;
  const auto source = open(camera);
  ASSERT_TRUE(source);
  EXPECT_EQ(source->info().rig.scan, Scan::kProgressive);
  EXPECT_NEAR(source->info().rig.frame_rate, 50, 1e-9);
  EXPECT_TRUE(source->info().live);
  camera.film(0, 6);
  for (std::uint64_t i = 0; i < 3; ++i) {
    const CapturedFrame frame = next(*source);
    EXPECT_EQ(frame.number, i);
    EXPECT_EQ(frame.picture.row(0)[0], 2 * i);
    EXPECT_EQ(frame.complement.row(3)[23], 2 * i + 1);
    EXPECT_EQ(frame.time_ns,
              FakeCamera::kUtc_ns + 1'000'000'000 + (2 * static_cast<std::int64_t>(i) + 1) * 10'000'000);
  }
}

TEST(CameraSource, OddPairsBeginOneLater) {
  FakeCamera camera;
  const auto source = open(camera, {.odd_pairs = true});
  camera.film(0, 5);
  const CapturedFrame frame = next(*source);
  EXPECT_EQ(frame.number, 0u);
  EXPECT_EQ(frame.picture.row(0)[0], 1);
  EXPECT_EQ(frame.complement.row(0)[0], 2);
  EXPECT_EQ(next(*source).lost_before, 0u);
}

TEST(CameraSource, EvenNumbersAreSlidesWhicheverComesFirst) {
  FakeCamera camera;
  const auto source = open(camera);
  camera.film(7, 3);
  EXPECT_EQ(next(*source).picture.row(0)[0], 8);
}

TEST(CameraSource, ALostPictureLosesItsFrame) {
  for (const std::uint32_t missing : {4u, 5u}) {
    FakeCamera camera;
    const auto source = open(camera);
    camera.film(0, static_cast<int>(missing));
    camera.film(missing + 1, 8);
    std::uint64_t number = 0;
    for (int i = 0; i < 4; ++i, ++number) {
      if (number == 2) ++number;
      const CapturedFrame frame = next(*source);
      EXPECT_EQ(frame.number, number);
      EXPECT_EQ(frame.lost_before, number == 3 ? 1u : 0u);
      EXPECT_EQ(frame.complement.row(0)[0], frame.picture.row(0)[0] + 1);
    }
    EXPECT_EQ(source->counts().lost_frames, 1u);
  }
}

TEST(CameraSource, TheSequenceWrapsAndMayRestart) {
  FakeCamera camera;
  const auto source = open(camera);
  camera.film(UINT_MAX - 3, 8);
  for (std::uint64_t i = 0; i < 4; ++i) EXPECT_EQ(next(*source).number, i);
  camera.film(0, 4);  // a driver that begins again is no loss of four thousand million
  EXPECT_EQ(next(*source).number, 4u);
  EXPECT_EQ(source->counts().lost_frames, 0u);
}

TEST(CameraSource, ADriverThatDoesNotCountLosesNothing) {
  FakeCamera camera;
  const auto source = open(camera);
  for (std::uint8_t i = 0; i < 6; ++i) camera.shots.push_back({.sequence = 0, .value = i});
  for (std::uint64_t i = 0; i < 3; ++i) EXPECT_EQ(next(*source).picture.row(0)[0], 2 * i);
  EXPECT_EQ(source->counts().lost_frames, 0u);
}

TEST(CameraSource, APictureThatComesTwiceIsTakenOnce) {
  FakeCamera camera;
  const auto source = open(camera);
  camera.film(4, 3);
  camera.film(6, 2);  // as v4l2loopback gives its last picture again to a reader that waits
  camera.film(7, 3);
  for (const int value : {4, 6, 8}) {
    const CapturedFrame frame = next(*source);
    EXPECT_EQ(frame.picture.row(0)[0], value);
    EXPECT_EQ(frame.complement.row(0)[0], value + 1);
  }
  EXPECT_EQ(source->counts().lost_frames, 0u);
}

TEST(CameraSource, DamagedAndShortBuffersAreLeftOut) {
  FakeCamera camera;
  const auto source = open(camera);
  camera.film(0, 10);
  camera.shots[3].flags |= V4L2_BUF_FLAG_ERROR;
  camera.shots[6].short_by = 1;
  EXPECT_EQ(next(*source).number, 0u);
  EXPECT_EQ(next(*source).number, 2u);
  EXPECT_EQ(next(*source).number, 4u);
  EXPECT_EQ(source->counts().damaged_pictures, 2u);
  EXPECT_EQ(source->counts().lost_frames, 2u);
  EXPECT_EQ(camera.queued(), 6u);  // all are the driver's again
}

struct Alternating {
  const char* name;
  bool shared;  // both fields of a frame have one sequence number
};

class AlternatingFields : public testing::TestWithParam<Alternating> {};

TEST_P(AlternatingFields, MakeFramesOfTwo) {
  const bool shared = GetParam().shared;
  FakeCamera camera;
  camera.field = V4L2_FIELD_ALTERNATE;
  const auto source = open(camera);
  EXPECT_EQ(source->info().rig.scan, Scan::kInterlaced);
  EXPECT_EQ(source->info().rig.camera.height, 8);
  const auto field = [&](std::uint32_t frame, bool second) {
    camera.shots.push_back({.sequence = shared ? frame : 2 * frame + second,
                            .field = second ? V4L2_FIELD_BOTTOM : V4L2_FIELD_TOP,
                            .value = static_cast<std::uint8_t>(10 * frame + second)});
  };
  field(0, true);  // the end of a frame whose beginning was before
  for (std::uint32_t frame = 1; frame <= 6; ++frame) {
    if (frame != 3) field(frame, false);
    if (frame != 5) field(frame, true);
  }
  for (const int want : {1, 2, 4, 6}) {
    const CapturedFrame frame = next(*source);
    EXPECT_EQ(frame.number, static_cast<std::uint64_t>(want - 1));
    for (int y = 0; y < 8; ++y) EXPECT_EQ(frame.picture.row(y)[5], 10 * want + y % 2) << want;
  }
  EXPECT_EQ(source->counts().lost_frames, 2u);
}

INSTANTIATE_TEST_SUITE_P(Numbers, AlternatingFields,
                         testing::Values(Alternating{"Shared", true}, Alternating{"Each", false}),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(CameraSource, RefusalsSayWhatToDo) {
  FakeCamera camera;
  camera.open_error = ENOENT;
  EXPECT_SAYS(refusal(camera), "no such device");
  camera.open_error = EACCES;
  EXPECT_SAYS(refusal(camera), "usermod -aG video");
  camera.open_error = EBUSY;
  EXPECT_SAYS(refusal(camera), "in use by another program");
  camera.open_error = 0;
  camera.errors[VIDIOC_S_FMT] = {EBUSY};
  EXPECT_SAYS(refusal(camera), "in use by another program");
  camera.errors[VIDIOC_QUERYCAP] = {ENOTTY};
  EXPECT_SAYS(refusal(camera), "is no video device");
  camera.errors[VIDIOC_REQBUFS] = {ENOMEM};
  EXPECT_SAYS(refusal(camera), "refused to provide buffers");
  camera.errors[VIDIOC_STREAMON] = {EINVAL};
  EXPECT_SAYS(refusal(camera), "refused to start streaming");
  EXPECT_SAYS(refusal(camera, {.width = 16, .height = 16}), "gives 8x4 instead of 16x16");
  EXPECT_SAYS(refusal(camera, {.rate = 30}), "100.00 pictures a second");
  EXPECT_SAYS(refusal(camera, {.format = "YUYV"}), "give one of RGB24");
  EXPECT_SAYS(refusal(camera, {.format = "H264"}), "cannot be read");
  EXPECT_SAYS(refusal(camera, {.field = "interlaced"}), "gives progressive instead of interlaced");
  EXPECT_SAYS(refusal(camera, {.controls = {{"gain", "1"}}}), "has no control \"gain\"");
  EXPECT_SAYS(refusal(camera, {.dmabuf = true}), "leave --dmabuf out");
  camera.errors[VIDIOC_ENUM_FMT] = {EINVAL};
  EXPECT_SAYS(refusal(camera), "offers no format yet");
  camera.fourcc = V4L2_PIX_FMT_H264;
  EXPECT_SAYS(refusal(camera), "only H264");
  camera.fourcc = V4L2_PIX_FMT_RGB24;
  camera.field = V4L2_FIELD_TOP;
  EXPECT_SAYS(refusal(camera), "only the top field");
  camera.capabilities = V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_STREAMING;
  EXPECT_SAYS(refusal(camera), "is no camera");
  camera.capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_READWRITE;
  EXPECT_SAYS(refusal(camera), "cannot stream");
}

TEST(CameraSource, ARigWithoutWhatIsProjectedIsSaid) {
  const test::TempFolder folder;
  const auto rig = folder / "rig.yaml";
  std::ofstream(rig) << to_yaml(test::striped_scene().rig);
  FakeCamera camera;
  EXPECT_SAYS(refusal(camera, {.rig = rig.string()}),
              "pattern.yaml is missing, which says what is projected");
}

/// What a rig.yaml and a flag say of the field order, the driver of an alternating camera, and what holds.
struct Orders {
  std::string rig;  // a line of rig.yaml, or none
  std::string flag;
  FieldOrder held;
  bool told;
};

class FieldOrderOf : public testing::TestWithParam<Orders> {};

TEST_P(FieldOrderOf, TheFlagThenTheRigThenTheDriver) {
  const Orders& orders = GetParam();
  const test::TempFolder folder;
  test::StripedScene scene = test::striped_scene();
  scene.rig.camera.width = 8;
  scene.rig.camera.height = 8;
  std::string yaml = to_yaml(scene.rig);
  yaml.insert(yaml.find("frame_rate"), orders.rig);
  std::ofstream(folder / "rig.yaml") << yaml;
  std::ofstream(folder / "pattern.yaml") << to_yaml(scene.pattern);
  FakeCamera camera;  // which says that its top field comes first
  camera.field = V4L2_FIELD_ALTERNATE;
  testing::internal::CaptureStderr();
  const auto source = open(camera, {.rig = folder / "rig.yaml", .field_order = orders.flag});
  const std::string told = testing::internal::GetCapturedStderr();
  ASSERT_TRUE(source);
  EXPECT_EQ(source->info().rig.field_order, orders.held);
  EXPECT_EQ(told.find("/dev/video0 says that the top field is exposed first") != std::string::npos,
            orders.told)
      << told;
  // Frames are put together so.
  const bool top_first = orders.held == FieldOrder::kTop;
  const auto field = [&](std::uint32_t number, bool top) {
    camera.shots.push_back({.sequence = number,
                            .field = top ? V4L2_FIELD_TOP : V4L2_FIELD_BOTTOM,
                            .value = static_cast<std::uint8_t>(number)});
  };
  field(0, top_first);
  field(1, !top_first);
  const CapturedFrame frame = next(*source);
  EXPECT_EQ(frame.field_order, orders.held);
  EXPECT_EQ(frame.slide_field().row(0)[0], 0);
  EXPECT_EQ(frame.complement_field().row(0)[0], 1);
}

INSTANTIATE_TEST_SUITE_P(CameraSource, FieldOrderOf,
                         testing::Values(Orders{"", "", FieldOrder::kTop, false},
                                         Orders{"field_order: bottom\n", "", FieldOrder::kBottom, true},
                                         Orders{"field_order: top\n", "", FieldOrder::kTop, false},
                                         Orders{"field_order: bottom\n", "top", FieldOrder::kTop, false},
                                         Orders{"", "bottom", FieldOrder::kBottom, false}));

TEST(CameraSource, ARigsFieldOrderHoldsWhereTheCameraComesBack) {
  const test::TempFolder folder;
  test::StripedScene scene = test::striped_scene();
  scene.rig.camera.width = 8;
  scene.rig.camera.height = 8;
  scene.rig.field_order = FieldOrder::kBottom;
  std::ofstream(folder / "rig.yaml") << to_yaml(scene.rig);
  std::ofstream(folder / "pattern.yaml") << to_yaml(scene.pattern);
  FakeCamera camera;
  camera.field = V4L2_FIELD_INTERLACED;
  camera.height = 8;
  const auto source = open(camera, {.rig = folder / "rig.yaml"});
  ASSERT_TRUE(source);
  camera.film(0, 1);
  EXPECT_EQ(next(*source).field_order, FieldOrder::kBottom);
  camera.unplugged = true;
  EXPECT_SAYS(failure(*source), "unplugged");
  camera.unplugged = false;
  camera.film(0, 1);
  EXPECT_EQ(next(*source).field_order, FieldOrder::kBottom);
}

TEST(CameraSource, ADriverThatLiesAboutItsRowsIsRefused) {
  FakeCamera camera;
  camera.bytes_a_pixel = 2;  // rows shorter than their pixels
  EXPECT_SAYS(refusal(camera), "which cannot be");
}

TEST(CameraSource, UnpluggedFailsOnceAndGoesOnWhenItIsBack) {
  FakeCamera camera;
  const auto source = open(camera);
  camera.film(0, 2);
  EXPECT_EQ(next(*source).number, 0u);
  camera.unplugged = true;
  EXPECT_SAYS(failure(*source), "was unplugged");
  EXPECT_EQ(camera.opened, 0);
  EXPECT_EQ(camera.mapped, 0);
  int sleeps = 0;
  camera.on_sleep = [&] {
    if (++sleeps != 3) return;
    camera.unplugged = false;
    camera.film(0, 4);
  };
  const CapturedFrame back = next(*source);
  EXPECT_EQ(back.number, 1u);
  EXPECT_EQ(back.lost_before, 0u);
  EXPECT_EQ(source->counts().reconnects, 1u);
  EXPECT_EQ(sleeps, 3);
}

TEST(CameraSource, AnotherCameraInItsPlaceIsSaidOnce) {
  FakeCamera camera;
  const auto source = open(camera);
  camera.unplugged = true;
  EXPECT_SAYS(failure(*source), "was unplugged");
  camera.unplugged = false;
  camera.width = 16;
  EXPECT_SAYS(failure(*source), "instead of 8x4");
  int sleeps = 0;
  camera.on_sleep = [&] {
    if (++sleeps == 5) camera.width = 8, camera.film(0, 2);
  };
  EXPECT_EQ(next(*source).number, 0u);
}

TEST(CameraSource, StreamingIsStartedAgainAfterAFatalError) {
  FakeCamera camera;
  const auto source = open(camera);
  camera.film(0, 4);
  camera.errors[VIDIOC_DQBUF] = {0, 0, EIO};
  EXPECT_EQ(next(*source).number, 0u);
  EXPECT_EQ(next(*source).number, 1u);
  EXPECT_EQ(source->counts().restarts, 1u);
  EXPECT_EQ(camera.streams, 1);
  EXPECT_EQ(camera.mapped, 6);
}

TEST(CameraSource, ADriverThatGivesUpAtOnceEachTimeIsSaid) {
  FakeCamera camera;
  const auto source = open(camera);
  camera.film(0, 2);
  camera.errors[VIDIOC_DQBUF] = {EIO, EIO, EIO, EIO};
  EXPECT_SAYS(failure(*source), "gave up streaming");
  EXPECT_EQ(next(*source).number, 0u);  // opened anew
  EXPECT_EQ(source->counts().reconnects, 1u);
}

TEST(CameraSource, ARefusedBufferIsOfferedAgain) {
  FakeCamera camera;
  const auto source = open(camera, {.buffers = 2});
  camera.film(0, 8);
  camera.errors[VIDIOC_QBUF] = {EINVAL, EINVAL, EINVAL};
  for (std::uint64_t i = 0; i < 4; ++i) EXPECT_EQ(next(*source).number, i);
}

TEST(CameraSource, ALostSignalIsSaidOnceAndItsPicturesAreLost) {
  FakeCamera camera;
  camera.input_status = V4L2_IN_ST_NO_SIGNAL;
  const auto source = open(camera);
  EXPECT_SAYS(failure(*source), "no signal on input 0 (Camera)");
  camera.film(0, 4);  // noise
  camera.on_idle = [&] {
    camera.input_status = 0;
    if (camera.now_ns > 3'000'000'000 && camera.shots.empty()) camera.film(10, 2);
  };
  EXPECT_EQ(next(*source).picture.row(0)[0], 10);
}

TEST(CameraSource, ACameraThatGivesNothingIsSaidOnce) {
  FakeCamera camera;
  const auto source = open(camera);
  camera.film(0, 2);
  EXPECT_EQ(next(*source).number, 0u);
  EXPECT_SAYS(failure(*source), "/dev/video0: no picture for 5 s");
  EXPECT_LT(camera.now_ns, 8'000'000'000);
  camera.on_idle = [&] {
    if (camera.now_ns > 60'000'000'000 && camera.shots.empty()) camera.film(2, 2);
  };
  EXPECT_EQ(next(*source).number, 1u);
  camera.on_idle = [] {};
  EXPECT_SAYS(failure(*source), "no picture for 5 s");  // another time
}

TEST(CameraSource, ACameraWhosePicturesMakeNoFrameIsSaidOnce) {
  FakeCamera camera;
  const auto source = open(camera);
  camera.film(0, 2);
  EXPECT_EQ(next(*source).number, 0u);
  camera.film(2, 1500);  // 15 s
  for (auto shot = camera.shots.begin(); shot != camera.shots.end(); ++shot) shot->short_by = 1;
  const std::string damaged = failure(*source);
  // The other half of one that is damaged is not looked at.
  EXPECT_SAYS(damaged,
              "/dev/video0: no frame for 5 s: of 501 pictures 250 are damaged (a buffer of 95 bytes");
  EXPECT_LT(camera.now_ns, 8'000'000'000);
  camera.film(1502, 2);
  EXPECT_EQ(next(*source).number, 751u);

  for (std::uint32_t i = 0; i < 750; ++i) camera.film(1504 + 2 * i, 1);
  const std::string unpaired = failure(*source);
  EXPECT_SAYS(unpaired, " pictures none is followed by its other half");
  camera.film(3004, 2);
  EXPECT_EQ(next(*source).number, 1502u);
}

TEST(CameraSource, NoFrameIsAskedForWhileThereIsNoSignal) {
  FakeCamera camera;
  camera.input_status = V4L2_IN_ST_NO_SIGNAL;
  const auto source = open(camera);
  EXPECT_SAYS(failure(*source), "no signal");
  camera.film(0, 800);  // noise
  camera.on_idle = [&] {
    camera.input_status = 0;
    if (camera.now_ns > 12'000'000'000) camera.film(800, 2);
  };
  EXPECT_EQ(next(*source).picture.row(0)[0], 800 % 256);
}

TEST(CameraSource, StopEndsAWaitAndStaysTheEnd) {
  FakeCamera camera;
  const auto source = open(camera);
  camera.on_idle = [&] { source->request_stop(); };
  const auto end = source->next();
  ASSERT_TRUE(end);
  EXPECT_FALSE(*end);
  camera.film(0, 2);
  EXPECT_FALSE(*source->next());
}

TEST(CameraSource, StampsAtTheEndOfAPictureAreMovedToItsBeginning) {
  FakeCamera camera;
  const auto source = open(camera);
  camera.film(0, 2);
  for (auto& shot : camera.shots)
    shot.flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_EOF;
  EXPECT_EQ(next(*source).time_ns, FakeCamera::kUtc_ns + 1'000'000'000);
}

TEST(DriverClock, AnyClockBecomesUtc) {
  constexpr std::int64_t kUtc = 1'000'000, kSecond = 1'000'000'000;
  v4l2::DriverClock clock(5 * kSecond, 5 * kSecond + kUtc);
  EXPECT_EQ(clock.to_utc(6 * kSecond, true, 6 * kSecond + 3), 6 * kSecond + kUtc);
  // Not the clock that it says: taken as of now, and then followed.
  EXPECT_EQ(clock.to_utc(INT64_MAX - 10, true, 7 * kSecond), 7 * kSecond + kUtc);
  EXPECT_EQ(clock.to_utc(INT64_MAX, true, 7 * kSecond + 400), 7 * kSecond + 10 + kUtc);
  EXPECT_EQ(clock.to_utc(INT64_MIN + 9, true, 7 * kSecond + 500), 7 * kSecond + 20 + kUtc);  // it wrapped
  EXPECT_EQ(clock.to_utc(123, false, 8 * kSecond), 8 * kSecond + kUtc);                      // it jumped
  EXPECT_EQ(clock.to_utc(123 + kSecond, false, 9 * kSecond + 7), 9 * kSecond + kUtc);
  // Neither is later than now.
  EXPECT_EQ(clock.to_utc(123 + 2 * kSecond, false, 9 * kSecond + 500), 9 * kSecond + 500 + kUtc);
  EXPECT_EQ(clock.to_utc(14 * kSecond, true, 10 * kSecond), 10 * kSecond + kUtc);
}

TEST(CameraSource, AStampFromTheFutureIsOfOneFrameAlone) {
  FakeCamera camera;
  camera.field = V4L2_FIELD_INTERLACED;
  const auto source = open(camera);
  camera.film(0, 8);
  camera.shots[2].late_ns = -4'000'000'000;  // as USB cameras' own clocks have it now and then
  camera.shots[5].late_ns = 4'000'000'000;
  std::vector<std::int64_t> since;
  for (int i = 0; i < 8; ++i) since.push_back(next(*source).time_ns - FakeCamera::kUtc_ns - 1'000'000'000);
  for (std::size_t i = 0; i < since.size(); ++i) {
    if (i == 5) continue;
    EXPECT_EQ(since[i], static_cast<std::int64_t>(i + 1) * 10'000'000) << i;
  }
  EXPECT_EQ(since[5], since[4] + 1);  // none goes back
}

}  // namespace
}  // namespace relievo
