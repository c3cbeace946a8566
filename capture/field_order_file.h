// SPDX-License-Identifier: Apache-2.0
// Whether a rig.yaml states which field is exposed first. Where it is silent the top one is (docs/TAKES.md),
// but of a live camera the driver is asked then.
#pragma once

#include <filesystem>
#include <string>

#include "base/rig.h"

namespace relievo {

/// False of what cannot be read, too.
bool states_field_order(const std::filesystem::path& rig);

/// The text of a rig.yaml, which to_yaml() has made, with its field order stated also where it is the usual
/// one.
std::string with_field_order(std::string yaml, const Rig& rig);

/// `yaml`, which is to replace `before` or to be made of it, keeps a statement that is there.
std::string keeping_field_order(std::string yaml, const std::filesystem::path& before);

}  // namespace relievo
