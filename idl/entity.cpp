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

void DdsFree::operator()(dds_qos* qos) const {
  dds_delete_qos(qos);
}
void DdsFree::operator()(dds_listener* listener) const {
  dds_delete_listener(listener);
}

void take_all(std::int32_t reader, const std::function<void(const void*)>& use) {
  void* sample = nullptr;  // lent by Cyclone
  dds_sample_info_t info;
  while (dds_take(reader, &sample, &info, 1, 1) == 1) {
    if (info.valid_data) use(sample);
    dds_return_loan(reader, &sample, 1);
  }
}

}  // namespace relievo
