// SPDX-License-Identifier: Apache-2.0
#include "codec/geometry_profile.h"

#include <array>

namespace relievo {
namespace {

struct Profile {
  std::string_view name;
  GeometryCodec codec;
};
constexpr std::array kProfiles{Profile{"grid", GeometryCodec::kGrid},
                               Profile{"draco-mesh", GeometryCodec::kDracoMesh}};

}  // namespace

bool set_geometry_profile(std::string_view name, EncodeOptions& options) {
  for (const Profile& profile : kProfiles) {
    if (profile.name != name) continue;
    options.geometry = profile.codec;
    return true;
  }
  return false;
}

std::string geometry_profile_names() {
  std::string names;
  for (const Profile& profile : kProfiles) {
    if (!names.empty()) names += &profile == &kProfiles.back() ? " or " : ", ";
    names += profile.name;
  }
  return names;
}

}  // namespace relievo
