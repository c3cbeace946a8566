// SPDX-License-Identifier: Apache-2.0
// Recordings of a stream "s": small surfaces as its encoder makes them, received when the test says.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>

#include "codec/frame3d_codec.h"
#include "codec/recording.h"
#include "idl/cdr.h"
#include "idl/topics.h"
#include "tests/support/make_grid.h"

namespace relievo::test {

class MadeRecording {
 public:
  explicit MadeRecording(const std::filesystem::path& file, int key_interval = 1)
      : encoder_(grid_rig(kScene), grid_pattern(kScene)),
        options_{
            .geometry = GeometryCodec::kGrid, .texture = TextureCodec::kNone, .key_interval = key_interval} {
    auto writer = RecordingWriter::create(file, {});
    EXPECT_TRUE(writer.ok());
    writer_ = *std::move(writer);
    const TopicType& type = topic_type(Topic::kFrame);
    const auto channel = writer_->add_channel({type.type_name, "omgidl", type.idl},
                                              {type.topic_name, "cdr", type.type_name, {{"stream", "s"}}});
    EXPECT_TRUE(channel.ok());
    frames_ = *channel;
  }

  /// Returns whether it decodes without others.
  bool add(std::uint64_t sequence, std::uint64_t number, std::int64_t time_ns,
           std::optional<std::int64_t> camera_time_ns = {}) {
    GridScene scene = kScene;
    scene.seed = number + 1;
    Frame3D frame = grid_frame(scene);
    frame.number = number;
    frame.time_ns = camera_time_ns.value_or(time_ns);
    const auto data = encoder_.encode(frame, options_);
    EXPECT_TRUE(data.ok());
    EXPECT_TRUE(writer_
                    ->write({frames_, static_cast<std::uint32_t>(sequence), time_ns, time_ns,
                             write_frame_cdr({"s", sequence, number, time_ns, time_ns, *data})})
                    .ok());
    return is_key_frame(*data);
  }

  void finish() { EXPECT_TRUE(writer_->finish().ok()); }

 private:
  static constexpr GridScene kScene{.width = 160, .height = 96, .stripes = 20};

  FrameEncoder encoder_;
  const EncodeOptions options_;
  std::unique_ptr<RecordingWriter> writer_;
  std::uint16_t frames_ = 0;
};

}  // namespace relievo::test
