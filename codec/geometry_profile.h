// SPDX-License-Identifier: Apache-2.0
// Ways to send a surface by name, for options and configurations.
#pragma once

#include <string>
#include <string_view>

#include "codec/frame3d_codec.h"

namespace relievo {

/// Sets what the profile of that name does; false, and nothing set, where there is none.
bool set_geometry_profile(std::string_view name, EncodeOptions& options);
/// "grid, metric, ... or draco-mesh": for messages and help.
std::string geometry_profile_names();

}  // namespace relievo
