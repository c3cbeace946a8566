// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>

#include "capture/pattern/schedule.h"
#include "capture/source/field_source.h"

namespace relievo {

/// A copy of `pair` whose second exposure counts as its first.
inline CapturedFrame exchanged_pair(const CapturedFrame& pair) {
  CapturedFrame out = pair.clone();
  if (pair.scan == Scan::kInterlaced) {
    out.field_order = other(pair.field_order);
  } else {
    std::swap(out.picture, out.complement);
  }
  return out;
}

}  // namespace relievo
