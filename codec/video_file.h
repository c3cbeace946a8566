// SPDX-License-Identifier: Apache-2.0
// Textures as a video that any player shows: H.264 in MP4 or Matroska, through libavformat.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>

#include "base/image.h"
#include "base/result.h"

namespace relievo {

inline bool is_video_name(const std::filesystem::path& file) {
  return file.extension() == ".mp4" || file.extension() == ".mkv";
}

/// A file of that name appears, or is replaced, when finish() succeeds. One thread.
class VideoFile {
 public:
  /// Fails where is_video_name() does not hold, and in builds without libavformat
  /// or H.264.
  static Result<VideoFile> create(const std::filesystem::path& file);
  VideoFile(VideoFile&&) noexcept;
  VideoFile& operator=(VideoFile&&) noexcept;
  ~VideoFile();

  /// A section of texture codec 4 as it is, of a texture of that size. All of a file are of one size and of
  /// one encoder; the first builds on no other, the next ones each on the one before; times rise.
  Status add(std::span<const std::uint8_t> section, int width, int height, std::int64_t time_ns);
  /// Whether it can be added as what it is; else another encoder is needed for all of the file.
  Status check(std::span<const std::uint8_t> section, int width, int height) const;

  /// At least one picture was added.
  Status finish();

 private:
  struct State;
  explicit VideoFile(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace relievo
