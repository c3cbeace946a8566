// SPDX-License-Identifier: Apache-2.0
// A process's place in a DDS domain: the configured domain and one participant. Internal to idl/.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "base/result.h"
#include "idl/entity.h"
#include "idl/interface.h"
#include "idl/keys.h"
#include "idl/transport.h"

namespace relievo {

/// Shared by every publisher and subscriber of the process in that domain, since Cyclone configures a domain
/// once a process; closed with the last of them.
class Domain {
 public:
  /// A CYCLONEDDS_URI in the environment is honoured instead of our own configuration. Fails on a domain
  /// number out of range, an unknown interface, or where the process already has the domain on another
  /// interface or with other keys, or with bad keys. Any thread.
  static Result<std::shared_ptr<Domain>> open(const DomainOptions& options);

  std::int32_t participant() const { return participant_.get(); }

  /// Those that participant() has; null: it is in plain.
  const Keys* keys() const { return keys_ ? &*keys_ : nullptr; }

  /// Says and hears what is not secret: participant() itself where there are no keys. 0: there is none, since
  /// a CYCLONEDDS_URI configures the domain.
  std::int32_t plain_participant() const { return keys_ ? plain_participant_.get() : participant_.get(); }

 private:
  static Result<std::unique_ptr<Domain>> make(const DomainOptions& options,
                                              const std::optional<std::filesystem::path>& keys);
  Status open_beside(int domain, const NetworkInterface& interface);

  std::string interface_;
  std::optional<Keys> keys_;
  Entity domain_;  // before participant_: deleted after it
  Entity participant_;
  Entity plain_domain_;
  Entity plain_participant_;
};

}  // namespace relievo
