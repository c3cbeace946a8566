// SPDX-License-Identifier: Apache-2.0
// In builds without libavformat.
#include "capture/projector/slide_video.h"

namespace relievo {

Result<SlideVideo> write_slide_video(const std::filesystem::path&, const Pattern&, const SlideVideoOptions&) {
  return Error{
      "this build cannot write video: install libavformat-dev and libavcodec-dev and configure again, or "
      "write "
      "pictures with --out FOLDER"};
}

}  // namespace relievo
