// SPDX-License-Identifier: Apache-2.0
#include "server/stream_set.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <utility>

#include "base/log.h"
#include "base/thread_name.h"
#include "base/whole_file.h"
#include "idl/recording_segments.h"

namespace relievo {
namespace {

constexpr std::chrono::seconds kRetry{5};
constexpr std::size_t kLargestRigFile = 1 << 20;  // they have a few kilobytes

/// What is in the files that a camera's stream names, for which a disk may be waited for; one that cannot be
/// read has its own words when the stream is opened.
std::string files_of(const StreamConfig& config) {
  std::string all;
  if (!config.source.starts_with("v4l2:")) return all;
  std::vector<std::filesystem::path> files{config.camera.rig, config.camera.pattern};
  if (config.camera.pattern.empty())  // then it is beside the rig
    files[1] = std::filesystem::path(config.camera.rig).replace_filename("pattern.yaml");
  for (const auto& file : files) {
    if (const auto text = read_whole_file(file, kLargestRigFile)) all += *text;
    all += '\0';
  }
  return all;
}

}  // namespace

StreamSet::~StreamSet() {
  stop();
  for (auto& [name, entry] : entries_) entry->thread.join();
}

void StreamSet::apply(const std::vector<StreamConfig>& configs) {
  struct Wanted {
    const StreamConfig* config;
    std::string files;
  };
  std::map<std::string, Wanted> wanted;
  for (const StreamConfig& config : configs) wanted[name_of(config)] = {&config, files_of(config)};
  std::vector<std::unique_ptr<Entry>> old;
  std::unique_lock lock(mutex_);
  if (stopping_) return;
  applying_ = true;
  for (auto it = entries_.begin(); it != entries_.end();) {
    const auto found = wanted.find(it->first);
    if (found != wanted.end() && *found->second.config == it->second->config &&
        found->second.files == it->second->files) {
      wanted.erase(found);
      ++it;
      continue;
    }
    end(*it->second);
    old.push_back(std::move(it->second));
    it = entries_.erase(it);
  }
  lock.unlock();
  for (const auto& entry : old) {
    entry->thread.join();  // all have been told, so this takes one's time
    if (!entry->result)
      log_warning("stream " + name_of(entry->config) +
                  " ended with a failure: " + entry->result.error().message);
  }
  lock.lock();
  if (stopping_) wanted.clear();
  for (auto& [name, begins] : wanted) {
    auto& entry = entries_[name] = std::make_unique<Entry>();
    entry->config = *begins.config;
    entry->files = std::move(begins.files);
    entry->retries = retries_ || was_applied_;
    entry->paused = paused_.count(name) != 0;
    entry->again = entry->tried_before = was_applied_;
    entry->thread = std::thread([this, e = entry.get()] {
      name_this_thread("capture");  // whose stages have threads of their own
      run(*e);
    });
  }
  applying_ = false;
  was_applied_ = true;
  changed_.notify_all();
}

Status StreamSet::wait() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] {
    return !applying_ &&
           std::all_of(entries_.begin(), entries_.end(), [](const auto& one) { return one.second->ended; });
  });
  for (const auto& [name, entry] : entries_)
    if (!entry->result)
      return around_.config.streams.empty() ? entry->result : entry->result.error().in("stream " + name);
  return {};
}

void StreamSet::stop() {
  const std::lock_guard lock(mutex_);
  stopping_ = true;
  for (const auto& [name, entry] : entries_) end(*entry);
}

void StreamSet::request_key_frame(const std::string& stream) {
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(stream);
  if (found != entries_.end() && found->second->stream != nullptr) found->second->stream->request_key_frame();
}

std::vector<std::string> StreamSet::opened() const {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] {
    return std::all_of(entries_.begin(), entries_.end(), [](const auto& one) { return one.second->tried; });
  });
  std::vector<std::string> names;
  for (const auto& [name, entry] : entries_)
    if (entry->opened) names.push_back(name);
  return names;
}

std::optional<StreamConfig> StreamSet::config_of(const std::string& stream) const {
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(stream);
  return found == entries_.end() ? std::nullopt : std::optional(found->second->config);
}

Status StreamSet::pause(const std::string& stream) {
  std::unique_lock lock(mutex_);
  const auto find = [&]() -> Entry* {
    const auto found = entries_.find(stream);
    return found == entries_.end() || found->second->stopping ? nullptr : found->second.get();
  };
  Entry* entry = find();
  if (entry == nullptr || entry->ended) return Error{"the stream '" + stream + "' has ended"};
  paused_.insert(stream);
  entry->paused = true;
  entry->retries = true;  // what it finds when it goes on ends no server
  if (entry->stream != nullptr) entry->stream->stop();
  changed_.notify_all();
  // Looked for anew each time: another configuration may end it meanwhile.
  changed_.wait(lock, [&] {
    entry = find();
    return entry == nullptr || entry->waiting || entry->ended;
  });
  if (entry != nullptr && !entry->ended) return {};
  paused_.erase(stream);
  return Error{"the stream '" + stream + "' has ended meanwhile"};
}

void StreamSet::resume(const std::string& stream) {
  const auto config = config_of(stream);
  // Which may be new, and are those that it opens. A disk may be slow: nobody else is to wait for it.
  std::string files = config ? files_of(*config) : "";
  const std::lock_guard lock(mutex_);
  paused_.erase(stream);
  const auto found = entries_.find(stream);
  if (found == entries_.end()) return;
  if (found->second->config == config) found->second->files = std::move(files);
  found->second->paused = false;
  changed_.notify_all();
}

void StreamSet::end(Entry& entry) {
  entry.stopping = true;
  if (entry.stream != nullptr) entry.stream->stop();
  changed_.notify_all();
}

void StreamSet::run(Entry& entry) {
  std::string said;
  Status result;
  while (wait_while_paused(entry)) {
    result = run_once(entry);
    {
      const std::lock_guard lock(mutex_);
      if (entry.stopping) break;  // it is not tried again
      if (entry.paused && result) continue;
      if (result || !entry.retries) break;
    }
    const std::string name = name_of(entry.config);
    const std::string why = result.error().message;
    result = {};
    if (said != why)
      log_warning("stream " + name + ": " + why + "; it is tried again every " +
                  std::to_string(kRetry.count()) + " s");
    said = why;
    around_.board.say(name, "to be tried again: " + why, true);
    if (!wait_to_retry(entry)) break;
  }
  const std::lock_guard lock(mutex_);
  if (entry.retries) around_.board.forget(name_of(entry.config));
  entry.result = result;
  entry.tried = entry.ended = true;
  changed_.notify_all();
}

Status StreamSet::run_once(Entry& entry) {
  StreamConfig config = entry.config;
  if (!config.record.empty() && (entry.again || config.record_beside))
    config.record = unused_name(config.record);
  auto opened = ServedStream::open(config, around_, entry.stopping);
  const bool comes_later = std::exchange(entry.tried_before, true);
  entry.again = entry.again || opened;
  {
    const std::lock_guard lock(mutex_);
    entry.opened = entry.opened || opened;
    entry.tried = true;
    changed_.notify_all();
    if (entry.stopping || entry.paused) return {};
    if (!opened) return opened.error();
    entry.stream = opened->get();
  }
  const std::string label = around_.config.streams.empty() ? "" : name_of(config) + ": ";
  if (comes_later) log_info(label + "streaming from " + config.source);
  if (config.record != entry.config.record)
    log_info(label + "recorded to " + config.record + ": " + entry.config.record + " is there already");
  const Status done = (*opened)->run();
  const std::lock_guard lock(mutex_);
  entry.stream = nullptr;
  return done;
}

/// False where it is to end.
bool StreamSet::wait_to_retry(Entry& entry) {
  std::unique_lock lock(mutex_);
  return !changed_.wait_for(lock, kRetry, [&] { return entry.stopping || entry.paused; }) || !entry.stopping;
}

/// Returns when the stream is to run. False where it is to end.
bool StreamSet::wait_while_paused(Entry& entry) {
  std::unique_lock lock(mutex_);
  while (entry.paused && !entry.stopping) {
    entry.waiting = true;
    changed_.notify_all();
    around_.board.say(name_of(entry.config), "paused while its rig is calibrated", true);
    changed_.wait_for(lock, kRetry, [&] { return entry.stopping || !entry.paused; });
  }
  entry.waiting = false;
  return !entry.stopping;
}

}  // namespace relievo
