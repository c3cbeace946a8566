// SPDX-License-Identifier: Apache-2.0
#include "server/recording_desk.h"

#include <algorithm>

namespace relievo {

void RecordingDesk::add(const std::string& stream, StreamRecorder& recorder) {
  const std::lock_guard lock(mutex_);
  recorders_[stream] = &recorder;
}

void RecordingDesk::remove(const std::string& stream) {
  const std::lock_guard lock(mutex_);
  recorders_.erase(stream);
}

std::optional<RecordingState> RecordingDesk::state(const std::string& stream) const {
  const std::lock_guard lock(mutex_);
  const auto found = recorders_.find(stream);
  return found == recorders_.end() ? std::nullopt : std::optional(found->second->state());
}

Status RecordingDesk::start(const std::string& stream) {
  const std::lock_guard lock(mutex_);
  const auto found = recorders_.find(stream);
  return found == recorders_.end() ? Error{"stream '" + stream + "' has just ended"} : found->second->start();
}

Status RecordingDesk::stop(const std::string& stream) {
  const std::lock_guard lock(mutex_);
  const auto found = recorders_.find(stream);
  return found == recorders_.end() ? Error{"stream '" + stream + "' has just ended"} : found->second->stop();
}

bool RecordingDesk::is_open(const std::string& file) const {
  const std::lock_guard lock(mutex_);
  return std::any_of(recorders_.begin(), recorders_.end(),
                     [&](const auto& one) { return one.second->is_open(file); });
}

std::shared_ptr<const GrowingRecording> RecordingDesk::growing(const std::string& file) const {
  const std::lock_guard lock(mutex_);
  for (const auto& [stream, recorder] : recorders_)
    if (auto growing = recorder->growing(file)) return growing;
  return nullptr;
}

}  // namespace relievo
