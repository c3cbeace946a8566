// SPDX-License-Identifier: Apache-2.0
// In builds without libavformat.
#include "codec/video_file.h"

namespace relievo {

struct VideoFile::State {};

Result<VideoFile> VideoFile::create(const std::filesystem::path&) {
  return Error{
      "this build cannot write video: install libavformat-dev and libavcodec-dev and configure again, or "
      "export PNGs"};
}
VideoFile::VideoFile(std::unique_ptr<State> state) : state_(std::move(state)) {}
VideoFile::VideoFile(VideoFile&&) noexcept = default;
VideoFile& VideoFile::operator=(VideoFile&&) noexcept = default;
VideoFile::~VideoFile() = default;
Status VideoFile::add(std::span<const std::uint8_t>, int, int, std::int64_t) {
  return Error{"this build cannot write video"};
}
Status VideoFile::check(std::span<const std::uint8_t>, int, int) const {
  return Error{"this build cannot write video"};
}
Status VideoFile::finish() {
  return Error{"this build cannot write video"};
}

}  // namespace relievo
