// SPDX-License-Identifier: Apache-2.0
#include "server/recording_desk.h"

#include <algorithm>

namespace relievo {

void RecordingDesk::add(const std::string& stream, StreamRecorder& recorder) {
  const std::lock_guard lock(mutex_);
  recorders_[stream] = &recorder;
}

void RecordingDesk::remove(const std::string& stream, const RecordingState& last) {
  const std::lock_guard lock(mutex_);
  recorders_.erase(stream);
  if (!last.file.empty()) last_[stream] = last;
}

void RecordingDesk::add(const Recorder& recorder, const std::filesystem::path& file) {
  const auto folder = file.has_parent_path() ? file.parent_path() : ".";
  std::error_code ignored;
  if (!std::filesystem::equivalent(folder, folder_, ignored)) return;
  const std::lock_guard lock(mutex_);
  others_.insert(&recorder);
}

void RecordingDesk::remove(const Recorder& recorder) {
  const std::lock_guard lock(mutex_);
  others_.erase(&recorder);
}

std::optional<RecordingState> RecordingDesk::state(const std::string& stream) const {
  const std::lock_guard lock(mutex_);
  const auto found = recorders_.find(stream);
  if (found == recorders_.end()) return std::nullopt;
  const RecordingState now = found->second->state();
  const auto last = last_.find(stream);
  if (!now.file.empty() || last == last_.end()) return now;
  RecordingState state = last->second;
  state.room_bytes = now.room_bytes;
  state.pre_roll_s = now.pre_roll_s;
  return state;
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
                     [&](const auto& one) { return one.second->is_open(file); }) ||
         std::any_of(others_.begin(), others_.end(), [&](const Recorder* other) {
           return other->is_open() && other->file().filename() == file;
         });
}

std::shared_ptr<const GrowingRecording> RecordingDesk::growing(const std::string& file) const {
  const std::lock_guard lock(mutex_);
  for (const auto& [stream, recorder] : recorders_)
    if (auto growing = recorder->growing(file)) return growing;
  for (const Recorder* other : others_)
    if (other->file().filename() == file) return other->growing();
  return nullptr;
}

}  // namespace relievo
