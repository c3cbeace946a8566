// SPDX-License-Identifier: Apache-2.0
// Internal to idl/.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "base/result.h"
#include "idl/domain.h"

namespace relievo {

/// Long enough for discovery on a local network; the price of starting a stream.
constexpr std::chrono::milliseconds kDiscoveryWait{400};

/// Fails where a stream of that name is live in the domain, having waited for `wait` to hear of one.
Status check_name_is_free(const Domain& domain, const std::string& stream, std::chrono::milliseconds wait);

/// Logs, once of each, that another writer of the stream turned up while ours is live: two that began at the
/// same moment, or whose networks were apart then, did not hear of each other before.
class NameWatch {
 public:
  /// `own`: our writer of the description.
  static Result<std::unique_ptr<NameWatch>> create(const Domain& domain, const std::string& stream,
                                                   std::int32_t own);
  virtual ~NameWatch() = default;
};

}  // namespace relievo
