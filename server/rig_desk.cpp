// SPDX-License-Identifier: Apache-2.0
#include "server/rig_desk.h"

namespace relievo {

void RigDesk::add(const std::string& stream, RigProbe& probe) {
  const std::lock_guard lock(mutex_);
  probes_[stream] = &probe;
}

void RigDesk::remove(const std::string& stream) {
  const std::lock_guard lock(mutex_);
  probes_.erase(stream);
}

bool RigDesk::has(const std::string& stream) const {
  const std::lock_guard lock(mutex_);
  return probes_.contains(stream);
}

std::optional<std::shared_ptr<const RigView>> RigDesk::look(const std::string& stream,
                                                            const std::vector<std::string>& pictures) {
  const std::lock_guard lock(mutex_);
  const auto found = probes_.find(stream);
  if (found == probes_.end()) return std::nullopt;
  return found->second->look(pictures);
}

Status RigDesk::project(const std::string& stream, const std::string& shows) {
  const std::lock_guard lock(mutex_);
  const auto found = probes_.find(stream);
  if (found == probes_.end()) return Error{"there is no stream '" + stream + "' here whose pattern to show"};
  return projector_.start({stream, shows, found->second->rig(), found->second->pattern()});
}

}  // namespace relievo
