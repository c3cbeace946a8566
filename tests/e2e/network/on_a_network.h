// SPDX-License-Identifier: Apache-2.0
// What tests on a network share: recorders of a stream on its hosts, and what they have seen.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "base/time.h"
#include "codec/recording.h"
#include "tests/e2e/network/network.h"
#include "tests/support/process.h"
#include "tests/support/recorder_counts.h"
#include "tests/support/temp_folder.h"

namespace relievo::test {

class OnANetwork : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { unavailable_ = Network::enter(); }
  void SetUp() override {
    if (!unavailable_.empty()) GTEST_SKIP() << "no network of its own: " << unavailable_;
  }

  std::unique_ptr<Process> recorder(int host, const std::string& stream) {
    return std::make_unique<Process>(Network::on(host, {program("relievo"), "record", stream, "--interface",
                                                        Network::kInterface, "--out", file(host), "--json"}));
  }
  std::filesystem::path file(int host) const { return folder_ / (std::to_string(host) + ".mcap"); }

  /// Calls `look` with each frame that is in a host's file so far, until it returns false.
  template <typename Look>
  void each_frame(int host, const Look& look) const {
    const auto reader = RecordingReader::open(file(host));
    if (!reader) return;
    for (;;) {
      const auto message = (*reader)->next();
      if (!message || !*message) return;
      const bool is_frame = (*reader)->summary().channels[(*message)->channel].topic == "relievo/frame";
      if (is_frame && !look(**message)) return;
    }
  }

  bool has_frame(int host, std::uint64_t sequence) const {
    bool has = false;
    each_frame(host, [&](const RecordedMessage& frame) { return !(has = frame.sequence == sequence); });
    return has;
  }

  /// When a host's recorder had its first frame after a time, in seconds after it; nothing where it had none.
  std::optional<double> came_back_after_s(int host, std::int64_t time_ns) const {
    std::optional<double> after_s;
    each_frame(host, [&](const RecordedMessage& frame) {
      if (frame.log_time_ns > time_ns) after_s = seconds(frame.log_time_ns - time_ns);
      return !after_s;
    });
    return after_s;
  }

  const TempFolder folder_;

 private:
  static inline std::string unavailable_;
};

}  // namespace relievo::test
