// SPDX-License-Identifier: Apache-2.0
// What the stages of a stream's server have been doing, for /metrics of that server's own gateway.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "base/client_report.h"
#include "base/histogram.h"

namespace relievo {

/// Since the start. Times of a frame in each stage, without what it waited before it.
struct StageTimes {
  std::string_view decoder;  // as `--decoder` has it; of `auto` the one that decodes now,
  int line_stride = 1;       // every so many detection lines
  Histogram reconstruct, encode_geometry, encode_texture, publish;
  // Frames that wait now, before each stage.
  std::size_t waiting_reconstruct = 0, waiting_encode = 0, waiting_publish = 0;
  std::uint64_t sent_again_bytes = 0;  // that DDS readers had asked for a second time
  ClientReports clients;               // that read it over DDS and decode it
};

/// Every function may be called from any thread and returns at once.
class StageReport {
 public:
  virtual ~StageReport() = default;
  /// Nothing where no such stream is made here.
  virtual std::optional<StageTimes> stages(const std::string& stream) const = 0;
};

}  // namespace relievo
