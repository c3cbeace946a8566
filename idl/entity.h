// SPDX-License-Identifier: Apache-2.0
// Owns what Cyclone DDS gives out. Internal to idl/.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "base/result.h"

struct dds_qos;
struct dds_listener;

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

struct DdsFree {
  void operator()(dds_qos* qos) const;
  void operator()(dds_listener* listener) const;
};
using Qos = std::unique_ptr<dds_qos, DdsFree>;
using Listener = std::unique_ptr<dds_listener, DdsFree>;

/// Takes all samples of a reader, each lent to `use` as the topic's C type while it is called.
void take_all(std::int32_t reader, const std::function<void(const void*)>& use);

/// "what: reason" of a negative dds_return_t.
Error dds_error(std::int32_t code, const std::string& what);

}  // namespace relievo
