// SPDX-License-Identifier: Apache-2.0
// Proves: what `relievo info` counts of a recording over a restart of its server is of each session by
// itself, and of the times at which frames were received.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>

#include "base/time.h"
#include "tests/e2e/record_play.h"
#include "tests/support/temp_folder.h"

namespace relievo::test {
namespace {

constexpr std::int64_t kStep_ns = kNanosecondsPerSecond / 10;

/// A recording of what servers publish, received when the test says.
class Received {
 public:
  explicit Received(const std::filesystem::path& file) : writer_(*RecordingWriter::create(file, {})) {}

  /// Of a server that has just been started the frames of these numbers, a tenth of a second apart.
  void session(std::uint64_t first, std::uint64_t last) {
    std::filesystem::remove(part_);
    const auto served =
        run({program("relievo-server"), "serve", "--source", "sim:plane,width=160,height=120,stripes=30",
             "--stream", "s", "--web", "none", "--domain", kDomain, "--interface", "lo", "--fast", "--frames",
             "8", "--record", part_});
    ASSERT_EQ(served.status, 0) << served.err;
    again(first, last);
  }
  /// Of the same server.
  void again(std::uint64_t first, std::uint64_t last) {
    const auto reader = RecordingReader::open(part_);
    ASSERT_TRUE(reader.ok());
    const RecordingSummary& summary = (*reader)->summary();
    for (;;) {
      auto message = (*reader)->next();
      ASSERT_TRUE(message.ok());
      if (!*message) break;
      const RecordingChannel& channel = summary.channels[(*message)->channel];
      if (channel.topic == "relievo/frame") {
        if ((*message)->sequence < first || (*message)->sequence > last) continue;
        now_ns += kStep_ns;
        auto frame = read_frame_cdr((*message)->data);
        ASSERT_TRUE(frame.ok());
        frame->publish_time_ns = now_ns - behind_ns;
        (*message)->data = write_frame_cdr(*frame);
      } else if (channel.topic != "relievo/info") {
        continue;
      }
      const auto schema = std::ranges::find(summary.schemas, channel.schema, &RecordingSchema::name);
      const auto known = channels_.find(channel.topic);
      const std::uint16_t id =
          known != channels_.end() ? known->second : *writer_->add_channel(*schema, channel);
      channels_[channel.topic] = id;
      (*message)->channel = id;
      (*message)->log_time_ns = (*message)->publish_time_ns = now_ns;
      ASSERT_TRUE(writer_->write(**message).ok());
    }
  }
  void finish() { ASSERT_TRUE(writer_->finish().ok()); }
  void of_the_session_of(const Received& other) { std::filesystem::copy_file(other.part_, part_); }

  std::int64_t now_ns = 1'700'000'000 * kNanosecondsPerSecond;
  std::int64_t behind_ns = 0;  // what was published was so by the stream's clock

 private:
  const TempFolder folder_;
  const std::string part_ = folder_ / "part.mcap";
  std::unique_ptr<RecordingWriter> writer_;
  std::map<std::string, std::uint16_t> channels_;
};

TEST(RecordingInfo, NothingIsLostOrLateBetweenSessions) {
  const TempFolder folder;
  const auto file = folder / "s.mcap";
  Received received(file);
  ASSERT_NO_FATAL_FAILURE(received.session(0, 1));
  received.now_ns += 3600 * kNanosecondsPerSecond;
  ASSERT_NO_FATAL_FAILURE(received.session(4, 5));
  received.finish();
  const auto said = info(file);
  EXPECT_EQ(said["sessions"].size(), 2u);
  EXPECT_EQ(said["frames"], 4);
  EXPECT_EQ(said["lost"], 0);
  EXPECT_NEAR(said["frame_rate"].get<double>(), 10, 1e-6);
}

TEST(RecordingInfo, TheRateOfALoopIsThatOfWhatIsPlayed) {
  const TempFolder folder;
  const auto file = folder / "s.mcap";
  Received received(file);
  ASSERT_NO_FATAL_FAILURE(received.session(0, 4));
  for (int i = 0; i < 2; ++i) {
    received.behind_ns += 5 * kStep_ns;
    ASSERT_NO_FATAL_FAILURE(received.again(0, 4));
  }
  received.finish();
  const auto said = info(file);
  EXPECT_EQ(said["frames"], 15);
  EXPECT_EQ(said["lost"], 0);
  EXPECT_NEAR(said["frame_rate"].get<double>(), 10, 1e-6);
}

TEST(RecordingInfo, NothingIsLostBetweenFilesThatWereJoined) {
  const TempFolder folder;
  const auto first = folder / "a.mcap", second = folder / "b.mcap", joined = folder / "joined.mcap";
  {
    Received received(first);
    ASSERT_NO_FATAL_FAILURE(received.session(0, 2));
    received.finish();
    Received later(second);
    later.now_ns = received.now_ns + 3600 * kNanosecondsPerSecond;
    later.of_the_session_of(received);
    ASSERT_NO_FATAL_FAILURE(later.again(4, 6));
    later.finish();
  }
  std::ofstream out(joined, std::ios::binary);
  for (const auto& part : {first, second}) out << std::ifstream(part, std::ios::binary).rdbuf();
  out.close();
  const auto said = info(joined);
  EXPECT_EQ(said["recordings"], 2);
  EXPECT_EQ(said["sessions"].size(), 1u);
  EXPECT_EQ(said["frames"], 6);
  EXPECT_EQ(said["lost"], 0);
  EXPECT_NEAR(said["frame_rate"].get<double>(), 10, 1e-6);
}

}  // namespace
}  // namespace relievo::test
