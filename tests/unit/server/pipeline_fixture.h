// SPDX-License-Identifier: Apache-2.0
// A pipeline between a source and sinks that a test controls.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <numeric>
#include <utility>
#include <vector>

#include "codec/frame3d_codec.h"
#include "server/pipeline.h"
#include "tests/unit/server/fakes.h"

namespace relievo::test {

inline PipelineOptions fast_and_lossless() {
  PipelineOptions options;
  options.stream = "test";
  options.paced = false;
  options.lossless = true;
  return options;
}

inline std::unique_ptr<Pipeline> make(FieldSource& source, std::vector<FrameSink*> sinks,
                                      const PipelineOptions& options) {
  auto made = Pipeline::create(source, std::move(sinks), options);
  EXPECT_TRUE(made) << made.error().message;
  return *std::move(made);
}

inline std::vector<std::uint64_t> numbers(const std::vector<FrameMessage>& frames) {
  std::vector<std::uint64_t> out;
  for (const FrameMessage& f : frames) out.push_back(f.number);
  return out;
}

inline std::vector<std::uint64_t> range(std::uint64_t first, std::uint64_t end) {
  std::vector<std::uint64_t> out(end - first);
  std::iota(out.begin(), out.end(), first);
  return out;
}

inline void expect_no_gaps(const std::vector<FrameMessage>& frames) {
  for (std::size_t i = 0; i < frames.size(); ++i) EXPECT_EQ(frames[i].sequence, i);
}

/// A key frame is followed by frames that build on each other.
inline PipelineOptions keys_are_rare() {
  PipelineOptions options;
  options.encode.key_interval = 100;
  options.encode.texture = TextureCodec::kH264;
  return options;
}

/// Each by what came before it.
inline void expect_all_decode(const std::vector<FrameMessage>& frames) {
  FrameDecoder decoder;
  for (const FrameMessage& message : frames) {
    const auto decoded = decoder.decode(*message.data);
    EXPECT_TRUE(decoded.ok()) << message.number << ": " << decoded.error().message;
  }
}

class PipelineTest : public ::testing::Test {
 protected:
  const StripedScene scene_ = striped_scene();
  const Frames frames_{scene_};
  CollectingSink sink_;

  /// The sink opens `entered` with frame 1, and is done with it when `release` is open.
  void hold_frame_1(Gate& entered, Gate& release) {
    sink_.on_frame = [&](const FrameMessage& frame) -> Status {
      if (frame.number == 1) {
        entered.open();
        release.wait();
      }
      return {};
    };
  }
};

}  // namespace relievo::test
