// SPDX-License-Identifier: Apache-2.0
#include "bench/grid_stages.h"

#include "base/time.h"

namespace relievo::bench {

GridStages::GridStages(const Rig& rig, const Pattern& pattern)
    : calibration_(grid_calibration(rig, pattern)), points_(calibration_) {}

Status GridStages::measure(const Surface& surface) {
  const std::int64_t begin = steady_now_ns();
  if (auto status = to_grid(surface, calibration_, {}, sent_); !status) return status;
  const std::int64_t gathered = steady_now_ns();
  const Bytes coded = encoder_.encode(sent_, calibration_, nullptr, {}, 1, {});
  const std::int64_t encoded = steady_now_ns();
  const auto head = decoder_.decode(coded, sent_.vertices, sent_.triangles, nullptr, received_);
  const std::int64_t decoded = steady_now_ns();
  if (!head) return head.error();
  if (auto status = points_.to_surface(received_, surface_); !status) return status;
  const std::int64_t end = steady_now_ns();
  const auto ns = [&](std::int64_t time) {
    return static_cast<double>(time) / static_cast<double>(sent_.vertices);
  };
  gather_ns_.push_back(ns(gathered - begin));
  code_ns_.push_back(ns(encoded - gathered));
  decode_ns_.push_back(ns(decoded - encoded));
  surface_ns_.push_back(ns(end - decoded));
  return {};
}

std::vector<Figure> GridStages::figures() const {
  return {{"ns_per_vertex.gather", spread_of(gather_ns_)},
          {"ns_per_vertex.code", spread_of(code_ns_)},
          {"ns_per_vertex.decode", spread_of(decode_ns_)},
          {"ns_per_vertex.surface", spread_of(surface_ns_)}};
}

}  // namespace relievo::bench
