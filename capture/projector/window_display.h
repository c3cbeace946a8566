// SPDX-License-Identifier: Apache-2.0
// A projector on a desktop (X11): a full-screen OpenGL window, swapped in step with the vertical refresh.
#pragma once

#include <memory>
#include <vector>

#include "base/result.h"
#include "capture/projector/display.h"

namespace relievo {

/// Outputs of the desktop. Main thread. Fails where there is no desktop, or this build is without GLFW.
Result<std::vector<DisplayOutput>> window_outputs();

/// Main thread, one at a time. The output's mode and gamma are as before when the display is destroyed. Fails
/// with the outputs or modes there are where the wanted one is none of them.
Result<std::unique_ptr<Display>> open_window_display(const DisplayChoice& choice);

}  // namespace relievo
