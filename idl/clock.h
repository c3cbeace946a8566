// SPDX-License-Identifier: Apache-2.0
// Answers what time it is at a stream's server. Internal to idl/; who asks uses ClockProbe of
// idl/transport.h.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "base/client_report.h"
#include "base/result.h"
#include "idl/domain.h"

namespace relievo {

/// What a clock shows, UTC ns. Any thread.
using Clock = std::function<std::int64_t()>;

/// Answers on a thread of DDS, from creation to destruction.
class ClockService {
 public:
  /// `clock` empty: the system's. Fails where the keys of the domain say nothing of clocks, as older ones do.
  static Result<std::unique_ptr<ClockService>> create(const Domain& domain, const std::string& stream,
                                                      Clock clock);
  virtual ~ClockService() = default;

  /// What those who asked said of themselves. Any thread.
  virtual ClientReports client_reports() const = 0;
};

/// The same for a stream that goes on without: null, and why not is logged.
std::unique_ptr<ClockService> create_clock_service(const Domain& domain, const std::string& stream,
                                                   Clock clock = {});

}  // namespace relievo
