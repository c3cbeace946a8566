// SPDX-License-Identifier: Apache-2.0
// How far off the places are that colour's zero crossings and luma give boundaries, beyond what noise
// explains: a frame tells it itself. How far the two are apart is the variance of both together, and how much
// more luma scatters about cubics through the zero crossings beside it on the line than colour does is what
// luma's is more than colour's: what the surface itself is off these cubics is in both. Of stripes about as
// narrow as the blur is wide luma never has its levels, and is off; where the scene has contrast it mostly
// is.
#pragma once

#include <vector>

#include "base/parallel.h"
#include "capture/reconstruct/edges.h"
#include "capture/reconstruct/ranked_sample.h"
#include "capture/reconstruct/sequence.h"

namespace relievo {

/// Where luma has the boundary of an edge, and what noise and contrast make of it.
struct LumaSeen {
  float column_px, sigma_px, level_px;
  bool steep;  // luma places it well
  bool found;
};

/// Standard deviations of a place beyond its noise: of any, and what a contrast of 1 adds.
struct PlaceErrors {
  float px, by_contrast_px;
};
struct ColourAndLumaErrors {
  PlaceErrors colour, luma;
};

/// In this order, a frame: begin(), line() of all, settle_plain(), apart() of edges, errors(). One thread but
/// for line() and apart(): each worker has its own memory.
class PlaceScatter {
 public:
  void begin(int workers);

  /// What the edges of a line tell, as EdgeFinder placed them; `seen` has one for each of `edges`. One line
  /// in three is asked.
  void line(const EdgeImage& edges, const SequenceResult& result, const std::vector<LumaSeen>& seen, int line,
            int worker);
  void settle_plain(WorkerPool& pool);
  /// Of luma in the frame at hand, after settle_plain().
  float luma_px() const { return luma_px_; }

  /// What an edge tells that has contrast around it. `still`: nothing moved there.
  void apart(const Edge& edge, const LumaSeen& luma, bool still, int worker);

  struct Errors {
    ColourAndLumaErrors still;
    /// Where things move both fields show other surfaces, and what colour and luma have in common is
    /// unknown: all is taken for colour's. Where few move it is as where nothing does.
    ColourAndLumaErrors moving;
  };
  Errors errors(WorkerPool& pool);

 private:
  struct Squares {              // of distances
    RankedSample apart;         // luma from colour,
    RankedSample colour, luma;  // and either from the cubics
  };
  struct Variances {
    RankedSample colour, luma;
  };
  Squares plain_;              // where nothing but stripes is seen,
  Variances noise_;            // and of the same places
  Squares contrasty_;          // less noise, over contrast, where nothing moves
  RankedSample apart_moving_;  // the same where it does
  float colour_px_ = 0, luma_px_ = 0;
};

}  // namespace relievo
