// SPDX-License-Identifier: Apache-2.0
// Pictures coded into a video that any player shows.
#pragma once

#include <cstdint>
#include <memory>

#include "base/image.h"
#include "base/result.h"
#include "codec/texture_codec.h"
#include "codec/video_file.h"

namespace relievo {

/// H.264 with a key frame about once a second. One thread.
class PictureVideo {
 public:
  explicit PictureVideo(VideoFile file);

  /// RGB or grey, all of one size; times rise.
  Status add(View8 picture, std::int64_t time_ns);
  /// At least one picture was added. The file appears now.
  Status finish() { return file_.finish(); }

 private:
  VideoFile file_;
  std::unique_ptr<TextureEncoder> encoder_;
  Bytes coded_;
  int number_ = 0;
};

}  // namespace relievo
