// SPDX-License-Identifier: Apache-2.0
// Those who look at a server's streams for whoever sets up their rigs, as the gateway asks for them.
#pragma once

#include <map>
#include <mutex>
#include <string>

#include "server/projector_driver.h"
#include "server/rig_probe.h"
#include "web/gateway/rig_control.h"

namespace relievo {

/// Every function may be called from any thread.
class RigDesk final : public RigControl {
 public:
  explicit RigDesk(const ProjectorConfig& projector) : projector_(projector) {}

  /// `probe` must live until it is removed.
  void add(const std::string& stream, RigProbe& probe);
  void remove(const std::string& stream);

  bool has(const std::string& stream) const override;
  std::optional<std::shared_ptr<const RigView>> look(const std::string& stream,
                                                     const std::vector<std::string>& pictures) override;
  ProjectorState projector() const override { return projector_.state(); }
  Status project(const std::string& stream, const std::string& shows) override;
  Status stop_projecting() override { return projector_.stop(); }

  ProjectorDriver& driver() { return projector_; }

 private:
  mutable std::mutex mutex_;
  std::map<std::string, RigProbe*> probes_;
  ProjectorDriver projector_;
};

}  // namespace relievo
