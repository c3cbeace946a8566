// SPDX-License-Identifier: Apache-2.0
// In builds without GLFW.
#include "capture/projector/window_display.h"

namespace relievo {
namespace {

const Error kMissing{"this build cannot project: install libglfw3-dev and libgl-dev and configure again"};

}  // namespace

Result<std::vector<DisplayOutput>> window_outputs() {
  return kMissing;
}

Result<std::unique_ptr<Display>> open_window_display(const DisplayChoice&) {
  return kMissing;
}

}  // namespace relievo
