// SPDX-License-Identifier: Apache-2.0
#include "idl/entity.h"

#include <dds/dds.h>

namespace relievo {

Entity::~Entity() {
  if (handle_ > 0) dds_delete(handle_);
}

Result<Entity> take_entity(std::int32_t handle_or_error, const std::string& what) {
  if (handle_or_error < 0) return dds_error(handle_or_error, "cannot make the DDS " + what);
  return Entity(handle_or_error);
}

Error dds_error(std::int32_t code, const std::string& what) {
  return {what + ": " + dds_strretcode(code)};
}

}  // namespace relievo
