// SPDX-License-Identifier: Apache-2.0
// Views under our own stripes as folders of pictures, and the slides to project for them. The pictures are in
// the order of their names: the slides along columns, slide 1 first, each before its complement; then those
// along rows. An interlaced camera's frames, where the rows of one field show a slide and those of the other
// its complement, are one picture a slide.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/rig.h"
#include "capture/calibrate/stripe_decode.h"

namespace relievo {

/// "columns_slide1", "columns_slide1_complement", ..., "rows_slide2_complement": names that sort into the
/// order of projection. Interlaced: "columns_frame1", ...
std::vector<std::string> stripe_view_names(int slides, Scan scan);

struct ReadStripesOptions {
  FieldOrder field_order = FieldOrder::kTop;                      // of an interlaced camera's frames
  std::function<bool(std::size_t, std::size_t)> on_picture = {};  // as in read_gray_stack()
};

/// 4 * slides or 2 * slides pictures of any common format, in natural order of names. Pictures of the latter
/// are de-interlaced. Errors name the folder or the file.
Result<StripeStack> read_stripe_stack(const std::filesystem::path& folder, const Pattern& pattern,
                                      int projector_width, int projector_height,
                                      const ReadStripesOptions& options = {});

/// Writes the stack's pictures, whole frames, named as above, to an existing folder.
Status write_stripe_view(const std::filesystem::path& folder, const StripeStack& stack);

/// Each picture of the pair from the rows of an interlaced frame that show it, the rows between interpolated.
/// The slide is on every second row from `slide_row`, 0 or 1.
StripePair deinterlaced(const Image8& frame, int slide_row = 0);

/// The slides to project, in that order; of an interlaced scan with the slide on the rows of the field that
/// comes first. Fails where stripes are narrower than a pixel.
Result<std::vector<Image8>> draw_stripe_slides(const Pattern& pattern, int projector_width,
                                               int projector_height, Scan scan,
                                               FieldOrder first = FieldOrder::kTop);

/// Writes them, named as above, to an existing folder.
Status write_stripe_slides(const std::filesystem::path& folder, const Pattern& pattern, int projector_width,
                           int projector_height, Scan scan, FieldOrder first = FieldOrder::kTop);

}  // namespace relievo
