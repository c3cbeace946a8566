// SPDX-License-Identifier: Apache-2.0
#include "capture/source/sim/scene.h"

#include <string_view>

namespace relievo::sim {
namespace {

struct SceneKind {
  std::string_view name;  // ends in ':' where an argument follows
  std::string_view usage;
  Result<std::shared_ptr<const Scene>> (*make)(const std::string& argument);
};

constexpr SceneKind kScenes[] = {
    {"plane", "plane", make_plane_scene},    {"object", "object", make_object_scene},
    {"face", "face", make_face_scene},       {"walk", "walk", make_walk_scene},
    {"mesh:", "mesh:FILE", make_mesh_scene},
};

Result<const SceneKind*> kind_of(const std::string& name) {
  for (const SceneKind& kind : kScenes)
    if (kind.name.back() == ':' ? name.starts_with(kind.name) : name == kind.name) return &kind;
  return Error{"unknown scene \"" + name + "\": give one of " + scene_names()};
}

}  // namespace

std::string scene_names() {
  std::string out;
  for (const SceneKind& kind : kScenes) out += (out.empty() ? "" : ", ") + std::string(kind.usage);
  return out;
}

Result<std::shared_ptr<const Scene>> make_scene(const std::string& name) {
  const auto kind = kind_of(name);
  return kind ? (*kind)->make(name.substr((*kind)->name.size())) : kind.error();
}

Status check_scene(const std::string& name) {
  const auto kind = kind_of(name);
  return kind ? Status() : kind.error();
}

}  // namespace relievo::sim
