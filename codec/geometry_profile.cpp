// SPDX-License-Identifier: Apache-2.0
#include "codec/geometry_profile.h"

#include <array>

#include "codec/row_names.h"

namespace relievo {
namespace {

constexpr int kLongInterval = 30;  // of profiles that profit from what went before
constexpr float kUsualBound_px = 0.5F;

struct Profile {
  std::string_view name;
  void (*set)(EncodeOptions& options);
};
constexpr std::array kProfiles{
    Profile{"grid", [](EncodeOptions& o) { o.geometry = GeometryCodec::kGrid; }},
    Profile{"metric",
            [](EncodeOptions& o) {
              o.geometry = GeometryCodec::kGrid;
              o.estimate = true;
              o.key_interval = kLongInterval;
            }},
    Profile{"visual",
            [](EncodeOptions& o) {
              o.geometry = GeometryCodec::kGrid;
              o.bound_px = kUsualBound_px;
              o.quality = false;
              o.key_interval = kLongInterval;
            }},
    Profile{"draco-grid", [](EncodeOptions& o) { o.geometry = GeometryCodec::kDracoGrid; }},
    Profile{"draco-mesh", [](EncodeOptions& o) { o.geometry = GeometryCodec::kDracoMesh; }}};

}  // namespace

bool set_geometry_profile(std::string_view name, EncodeOptions& options) {
  for (const Profile& profile : kProfiles) {
    if (profile.name != name) continue;
    profile.set(options);
    return true;
  }
  return false;
}

std::string geometry_profile_names() {
  return names_of(kProfiles);
}

}  // namespace relievo
