// SPDX-License-Identifier: Apache-2.0
// Owns one Cyclone DDS entity. Internal to idl/.
#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "base/result.h"

namespace relievo {

/// A dds_entity_t, deleted (with its children) in the destructor. Move-only.
class Entity {
 public:
  Entity() = default;
  explicit Entity(std::int32_t handle) : handle_(handle) {}
  Entity(Entity&& other) noexcept : handle_(std::exchange(other.handle_, 0)) {}
  Entity& operator=(Entity&& other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  ~Entity();

  std::int32_t get() const { return handle_; }

 private:
  std::int32_t handle_ = 0;
};

/// Wraps what a dds_create_* returned: an entity, or an error that says what was to be made and why not.
Result<Entity> take_entity(std::int32_t handle_or_error, const std::string& what);

/// "what: reason" of a negative dds_return_t.
Error dds_error(std::int32_t code, const std::string& what);

}  // namespace relievo
