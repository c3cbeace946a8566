// SPDX-License-Identifier: Apache-2.0
// What tests of `relievo record` and `play` share: the programs on the loopback, and what is in their files.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "codec/recording.h"
#include "idl/cdr.h"
#include "tests/support/own_domain.h"
#include "tests/support/process.h"

namespace relievo::test {

inline const std::string kDomain = std::to_string(own_domain());

inline std::vector<std::string> on_loopback(std::vector<std::string> command) {
  command.insert(command.begin(), program("relievo"));
  command.insert(command.end(), {"--domain", kDomain, "--interface", "lo"});
  return command;
}

/// Starts the stream "face" with its first reader: 60 frames a second with `bytes` of noise for data; 0: real
/// frames.
inline std::vector<std::string> publish_face(int bytes, int frames = 100'000) {
  return {program("test_publisher"), "face", kDomain, std::to_string(bytes), "60",
          std::to_string(frames),    "1"};
}

/// Records the first `frames` of a stream "face" whose frames have `bytes` of noise for data; 0: real frames.
inline void record_face(const std::filesystem::path& file, int bytes, int frames,
                        const std::vector<std::string>& more = {}) {
  Process server(publish_face(bytes));
  std::vector<std::string> command{"record", "face", "--out", file, "--frames", std::to_string(frames)};
  command.insert(command.end(), more.begin(), more.end());
  const auto done = run(on_loopback(std::move(command)));
  ASSERT_EQ(done.status, 0) << done.err;
}

inline std::vector<Bytes> recorded_frames(const std::filesystem::path& file) {
  std::vector<Bytes> frames;
  auto reader = RecordingReader::open(file);
  if (!reader) {
    ADD_FAILURE() << reader.error().message;
    return frames;
  }
  for (;;) {
    auto message = (*reader)->next();
    EXPECT_TRUE(message.ok()) << (message ? "" : message.error().message);
    if (!message || !*message) return frames;
    if ((*reader)->summary().channels[(*message)->channel].topic == "relievo/frame") {
      frames.push_back(std::move((*message)->data));
    }
  }
}

// Live frames go to readers that may be starved of processor time, so how many of them arrive is no promise;
// what arrives, in which order, and that what does not is counted, is.
struct Arrived {
  std::uint64_t lost = 0;  // gaps in the sequence
  double rate = 0;
};
inline Arrived arrived(const std::vector<Bytes>& frames) {
  Arrived found;
  std::uint64_t last = 0;
  std::int64_t first_ns = 0, last_ns = 0;
  for (const Bytes& cdr : frames) {
    const auto frame = read_frame_cdr(cdr);
    if (!frame) {
      ADD_FAILURE() << frame.error().message;
      continue;
    }
    if (first_ns == 0) first_ns = frame->publish_time_ns;
    if (last_ns != 0) found.lost += frame->sequence - last - 1;
    last = frame->sequence;
    last_ns = frame->publish_time_ns;
  }
  found.rate = static_cast<double>(frames.size() - 1) * 1e9 / static_cast<double>(last_ns - first_ns);
  return found;
}

inline nlohmann::json info(const std::filesystem::path& file) {
  const auto done = run({program("relievo"), "info", file, "--json"});
  EXPECT_EQ(done.status, 0) << done.err;
  return nlohmann::json::parse(done.out, nullptr, false);
}

}  // namespace relievo::test
