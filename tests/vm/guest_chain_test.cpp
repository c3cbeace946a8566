// SPDX-License-Identifier: Apache-2.0
// In the guest: a rig's frames go out through a driver, come back through a camera, and are kept as a take in
// $RELIEVO_SHARED, for the host to compare and reconstruct.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <deque>
#include <filesystem>
#include <fstream>
#include <thread>

#include "capture/source/take_writer.h"
#include "output_device.h"
#include "vivid.h"

namespace relievo::test {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kFrames = 10;

fs::path shared() {
  const char* folder = std::getenv("RELIEVO_SHARED");
  return folder ? folder : "";
}

std::vector<CapturedFrame> frames_of(const fs::path& take) {
  std::vector<CapturedFrame> frames;
  auto source = open_source("take:" + take.string(), {});
  EXPECT_TRUE(source) << source.error().message;
  while (source) {
    auto frame = (*source)->next();
    EXPECT_TRUE(frame) << frame.error().message;
    if (!frame || !*frame) break;
    frames.push_back(*std::move(*frame));
  }
  return frames;
}

std::span<const std::uint8_t> bytes(const Image8& picture) {
  return {picture.data(), picture.size()};
}

/// Rows first, first + 2, ...
Image8 field_of(const Image8& picture, int first) {
  Image8 field(picture.width(), picture.height() / 2, 3);
  for (int y = 0; y < field.height(); ++y)
    std::copy_n(picture.row(2 * y + first), picture.stride(), field.row(y));
  return field;
}

/// Plays over and over on a thread of its own, until the end of its life.
class Player {
 public:
  explicit Player(std::function<bool()> play_all)
      : thread_([this, play_all] {
          while (!stop_) {
            if (!play_all()) break;
          }
        }) {}
  ~Player() {
    stop_ = true;
    thread_.join();
  }

 private:
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// Frames that are in memory, for the take's writer.
class Kept final : public FieldSource {
 public:
  explicit Kept(SourceInfo info) : info_(std::move(info)) {}
  const SourceInfo& info() const override { return info_; }
  Result<std::optional<CapturedFrame>> next() override {
    if (frames.empty()) return std::optional<CapturedFrame>{};
    std::optional<CapturedFrame> frame(std::move(frames.front()));
    frames.pop_front();
    return frame;
  }
  void request_stop() override { frames.clear(); }

  std::deque<CapturedFrame> frames;

 private:
  const SourceInfo info_;
};

/// Keeps frames of the camera, from the first on that is one of the `played`.
void keep(const std::string& device, const CameraOptions& options, const std::vector<CapturedFrame>& played,
          const fs::path& take) {
  const auto source = open(device, options);
  ASSERT_TRUE(source);
  Kept kept(source->info());
  for (int tries = 0; tries < 40 && kept.frames.size() < kFrames; ++tries) {
    CapturedFrame frame = next(*source);
    const bool known =
        !kept.frames.empty() || std::any_of(played.begin(), played.end(), [&](const auto& one) {
          return std::ranges::equal(bytes(one.picture), bytes(frame.picture));
        });
    if (known) kept.frames.push_back(std::move(frame));  // not what came before the output's first picture
  }
  EXPECT_EQ(kept.frames.size(), kFrames);
  const Status written = write_take(take, kept, {});
  EXPECT_TRUE(written) << written.error().message;
}

void loop_through_vivid(const char* field) {
  const bool alternate = std::string(field) == "alternate";
  const fs::path rendered = shared() / "interlaced";
  const auto frames = frames_of(rendered);
  ASSERT_FALSE(frames.empty());
  std::vector<Image8> fields;  // bottom first, as NTSC has them
  for (const CapturedFrame& frame : frames) {
    for (const int first : {1, 0}) fields.push_back(field_of(frame.picture, first));
  }
  OutputDevice output("/dev/video1", {.width = 720,
                                      .height = alternate ? 240u : 480u,
                                      .field = alternate ? V4L2_FIELD_ALTERNATE : V4L2_FIELD_INTERLACED,
                                      .standard = V4L2_STD_NTSC_M});
  const Player player([&] {
    if (!alternate) {
      return std::ranges::all_of(frames, [&](const auto& f) { return output.play(bytes(f.picture), 0); });
    }
    for (std::size_t i = 0; i < fields.size(); ++i) {
      if (!output.play(bytes(fields[i]), i % 2 == 0 ? V4L2_FIELD_BOTTOM : V4L2_FIELD_TOP)) return false;
    }
    return true;
  });
  CameraOptions options{.rig = rendered / "rig.yaml",
                        .input = "S-Video 0",
                        .standard = "NTSC-M",
                        .format = "RGB24",
                        .field = field,
                        .controls = still("100_black")};
  options.controls.push_back({"loop_video", "1"});
  keep(kVivid, options, frames, shared() / (std::string("captured_") + field));
  set(kVivid, {{"loop_video", "0"}});
}

TEST(Chain, InterlacedThroughTheOutputAndBack) {
  loop_through_vivid("interlaced");
}

TEST(Chain, AlternatingFieldsThroughTheOutputAndBack) {
  loop_through_vivid("alternate");
}

void pause_ms(int ms) {
  std::this_thread::sleep_for(std::chrono::milliseconds(ms));
}

TEST(Chain, ProgressivePicturesThroughTheLoopback) {
  const fs::path rendered = shared() / "progressive";
  const auto frames = frames_of(rendered);
  ASSERT_FALSE(frames.empty());
  const auto width = static_cast<std::uint32_t>(frames[0].picture.width());
  const auto height = static_cast<std::uint32_t>(frames[0].picture.height());
  OutputDevice output(kLoopback, {.width = width, .height = height});
  std::atomic<bool> begun{false};
  const Player player([&] {
    for (const CapturedFrame& frame : frames) {
      for (const Image8* picture : {&frame.picture, &frame.complement}) {
        if (!output.write(bytes(*picture))) return false;
        begun = true;
        pause_ms(33);
      }
    }
    return true;
  });
  while (!begun) pause_ms(5);
  keep(kLoopback, {.rig = rendered / "rig.yaml", .format = "RGB24"}, frames,
       shared() / "captured_progressive");
}

std::vector<std::uint8_t> file_bytes(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST(Chain, MjpegIsDecodedAndDamageCounted) {
  const auto jpeg = file_bytes(shared() / "ramp.jpg");
  ASSERT_FALSE(jpeg.empty());
  const std::vector<std::uint8_t> torn(jpeg.begin(),
                                       jpeg.begin() + static_cast<std::ptrdiff_t>(jpeg.size() / 2));
  OutputDevice output("/dev/video21", {.fourcc = V4L2_PIX_FMT_MJPEG, .width = 64, .height = 48});
  ASSERT_TRUE(output.write(jpeg));
  const auto source = open("/dev/video21", {.format = "MJPEG"});
  ASSERT_TRUE(source);
  std::atomic<int> written{0};
  const Player player([&] {  // of every ten pictures the sixth is damaged
    const bool done = output.write(written % 10 == 5 ? torn : jpeg);
    ++written;
    pause_ms(33);
    return done;
  });
  for (int i = 0; i < 12; ++i) {
    const CapturedFrame frame = next(*source);
    for (const Image8* picture : {&frame.picture, &frame.complement}) {
      expect_picture(*picture, 3, [](int x, int y) { return Rgb{4.0 * x, 5.0 * y, 128}; });
    }
  }
  const SourceCounts counts = source->counts();
  EXPECT_GE(counts.damaged_pictures, 2u);
  EXPECT_EQ(counts.lost_frames, counts.damaged_pictures);  // each is half of another frame
}

}  // namespace
}  // namespace relievo::test
