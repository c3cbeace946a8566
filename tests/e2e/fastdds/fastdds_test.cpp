// SPDX-License-Identifier: Apache-2.0
// Proves: another DDS implementation gets the stream, every frame of it, beside a reader of ours.
#include <gtest/gtest.h>

#include <numeric>
#include <sstream>

#include "tests/support/own_domain.h"
#include "tests/support/process.h"
#include "tests/support/streams.h"

namespace relievo::test {
namespace {

TEST(FastDds, ReadsEveryFrame) {
  constexpr int kFrames = 20;
  constexpr std::size_t kBytes = 100'000;
  const std::string domain = std::to_string(own_domain());
  Process reader({program("fastdds_reader"), domain, "numbers", std::to_string(kFrames)});
  ASSERT_TRUE(reader.wait_for_text("reading")) << reader.err();
  Process publisher(
      {program("test_publisher"), "numbers", domain, std::to_string(kBytes), "5", "1000000", "1"});
  ASSERT_EQ(reader.wait(), 0) << reader.err() << publisher.err();
  std::istringstream lines(reader.out());
  std::uint64_t first = 0;
  for (std::uint64_t i = 0; i < kFrames; ++i) {
    std::uint64_t sequence = 0, number = 0, bytes = 0;
    unsigned sum = 0;
    ASSERT_TRUE(lines >> sequence >> number >> bytes >> sum) << reader.out();
    if (i == 0) first = sequence;
    const FrameMessage sent = example_frame(first + i, kBytes);
    EXPECT_EQ(sequence, sent.sequence);
    EXPECT_EQ(number, sent.number);
    EXPECT_EQ(bytes, kBytes);
    EXPECT_EQ(sum, std::accumulate(sent.data->begin(), sent.data->end(), 0u));
  }
}

}  // namespace
}  // namespace relievo::test
