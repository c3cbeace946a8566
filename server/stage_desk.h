// SPDX-License-Identifier: Apache-2.0
// The stages of a server's streams, as the gateway asks for them.
#pragma once

#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "web/gateway/stage_times.h"

namespace relievo {

/// Every function may be called from any thread.
class StageDesk final : public StageReport {
 public:
  /// `look` is called until the stream is removed.
  void add(const std::string& stream, std::function<StageTimes()> look) {
    const std::lock_guard lock(mutex_);
    looks_[stream] = std::move(look);
  }
  void remove(const std::string& stream) {
    const std::lock_guard lock(mutex_);
    looks_.erase(stream);
  }
  std::optional<StageTimes> stages(const std::string& stream) const override {
    const std::lock_guard lock(mutex_);
    const auto found = looks_.find(stream);
    return found == looks_.end() ? std::nullopt : std::optional(found->second());
  }

 private:
  mutable std::mutex mutex_;
  std::map<std::string, std::function<StageTimes()>> looks_;
};

}  // namespace relievo
