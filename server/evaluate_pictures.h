// SPDX-License-Identifier: Apache-2.0
// `evaluate --pictures DIR`: each scored frame's stages and errors as PNGs, and a page that shows them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/filter_counts.h"
#include "base/new_folder.h"
#include "base/result.h"
#include "capture/evaluate/pictures.h"
#include "capture/evaluate/score.h"

namespace relievo {

/// One thread.
class EvaluationPictures {
 public:
  /// Makes `folder` where it is missing.
  static Result<EvaluationPictures> create(const std::filesystem::path& folder, const Rig& rig,
                                           const Pattern& pattern);

  /// Of a scored frame and what became of it. `slide` is what it shows, from 0; `result` has a texture.
  Status add(const CapturedFrame& frame, int slide, const Frame3D& result, const Judgement& judgement);

  /// index.html, with the figures of all frames; `title` is what was evaluated.
  Status finish(const std::string& title, const Score& score, const FilterCounts& filters) const;

 private:
  struct Page {
    std::uint64_t number;
    std::size_t vertices, wrong, boundaries, found;
    double median_um_per_m;
  };
  EvaluationPictures(std::filesystem::path folder, NewFolder made, const Rig& rig, const Pattern& pattern)
      : folder_(std::move(folder)), made_(std::move(made)), rig_(rig), pattern_(pattern) {}

  std::filesystem::path folder_;
  NewFolder made_;
  Rig rig_;
  Pattern pattern_;
  std::vector<Page> pages_;
};

}  // namespace relievo
