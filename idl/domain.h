// SPDX-License-Identifier: Apache-2.0
// A process's place in a DDS domain: the configured domain and one participant. Internal to idl/.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "base/result.h"
#include "idl/entity.h"
#include "idl/transport.h"

namespace relievo {

/// Shared by every publisher and subscriber of the process in that domain, since Cyclone configures a domain
/// once a process; closed with the last of them.
class Domain {
 public:
  /// A CYCLONEDDS_URI in the environment is honoured instead of our own configuration. Fails on a domain
  /// number out of range, an unknown interface, or where the process already has the domain on another
  /// interface. Any thread.
  static Result<std::shared_ptr<Domain>> open(const DomainOptions& options);

  std::int32_t participant() const { return participant_.get(); }

 private:
  static Result<std::unique_ptr<Domain>> make(const DomainOptions& options);

  std::string interface_;
  Entity domain_;  // before participant_: deleted after it
  Entity participant_;
};

}  // namespace relievo
