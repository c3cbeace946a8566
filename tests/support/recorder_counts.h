// SPDX-License-Identifier: Apache-2.0
// What `relievo record --json` says at its end.
#pragma once

#include <gtest/gtest.h>
#include <signal.h>

#include <cstdint>
#include <nlohmann/json.hpp>

#include "tests/support/process.h"

namespace relievo::test {

struct RecorderCounts {
  std::uint64_t frames = 0, lost = 0;
};

/// Ends a recorder as Ctrl-C does, and reads its counts; a failure of the test where it says none.
inline RecorderCounts stop_recorder(Process& recorder) {
  recorder.signal(SIGINT);
  EXPECT_EQ(recorder.wait(), 0) << recorder.err();
  const auto said = nlohmann::json::parse(recorder.out(), nullptr, false);
  if (said.is_discarded()) {
    ADD_FAILURE() << recorder.out() << recorder.err();
    return {};
  }
  return {said["frames"], said["lost"]};
}

}  // namespace relievo::test
