// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/trial_decoder.h"

#include <utility>

#include "capture/pattern/schedule.h"
#include "capture/reconstruct/detection_lines.h"
#include "capture/reconstruct/slide_decoder.h"

namespace relievo {

CapturedFrame exchanged_pair(const CapturedFrame& pair) {
  CapturedFrame out = pair.clone();
  if (pair.scan == Scan::kInterlaced) {
    out.field_order = other(pair.field_order);
  } else {
    std::swap(out.picture, out.complement);
  }
  return out;
}

TrialDecoder::TrialDecoder(const Rig& rig, const Pattern& pattern, int line_stride)
    : rig_(rig), pattern_(pattern), options_{.decoder = Decoder::kQuick, .line_stride = line_stride} {}

ReconstructReport TrialDecoder::decode(std::initializer_list<const CapturedFrame*> pairs,
                                       WorkerPool& pool) const {
  SlideDecoder decoder(rig_, pattern_, options_);
  DecodedGrid grid;
  grid.reset(pattern_.boundaries(), line_count(rig_, options_.line_stride));
  ReconstructReport report;
  for (const CapturedFrame* pair : pairs) {
    report = {};
    decoder.observe(*pair, pool, report);
    decoder.decode({*pair, nullptr}, pool, report, grid);
  }
  return report;
}

}  // namespace relievo
