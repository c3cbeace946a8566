// SPDX-License-Identifier: Apache-2.0
// Keeps what a stream's clients say of themselves, and what they did all together. Internal to idl/.
#pragma once

#include <cstdint>
#include <map>

#include "base/client_report.h"

namespace relievo {

/// One thread. Bounded whatever peers say.
class ClientReportBook {
 public:
  static constexpr std::size_t kMaxClients = 256;             // further ones are not heard
  static constexpr std::int64_t kForget_ns = 10'000'000'000;  // of silence; clients speak once a second
  static constexpr std::size_t kMaxName = 64;                 // characters

  /// `now_ns` of a steady clock. A client's first report is what its next one is compared with, so that what
  /// it did at a server before this one counts there alone.
  void add(ClientReport report, std::int64_t now_ns);
  ClientReports reports(std::int64_t now_ns) const;

 private:
  struct Entry {
    ClientReport report;
    std::int64_t heard_ns = 0;
  };
  std::map<std::uint64_t, Entry> clients_;
  Histogram decode_, decoded_after_;
};

}  // namespace relievo
