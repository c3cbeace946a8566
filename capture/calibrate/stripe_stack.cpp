// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/stripe_stack.h"

#include <algorithm>
#include <utility>

#include "capture/calibrate/pictures.h"
#include "capture/pattern/schedule.h"
#include "capture/pattern/slides.h"
#include "capture/picture_file.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

/// Rows of `first`'s parity from the frame, those between as the mean of their neighbours.
Image8 one_field(const Image8& frame, int first) {
  Image8 out = frame.clone();
  const auto length = static_cast<std::size_t>(frame.stride());
  for (int y = 1 - first; y < frame.height(); y += 2) {
    const std::uint8_t* above = frame.row(y > 0 ? y - 1 : y + 1);
    const std::uint8_t* below = frame.row(y + 1 < frame.height() ? y + 1 : y - 1);
    std::uint8_t* row = out.row(y);
    for (std::size_t i = 0; i < length; ++i)
      row[i] = static_cast<std::uint8_t>((above[i] + below[i] + 1) / 2);
  }
  return out;
}

std::string number(std::size_t n) {
  return std::to_string(n);
}

}  // namespace

std::vector<std::string> stripe_view_names(int slides, Scan scan) {
  std::vector<std::string> out;
  for (const char* axis : {"columns", "rows"}) {
    for (int slide = 1; slide <= slides; ++slide) {
      if (scan == Scan::kInterlaced) {
        out.push_back(std::string(axis) + "_frame" + std::to_string(slide));
        continue;
      }
      out.push_back(std::string(axis) + "_slide" + std::to_string(slide));
      out.push_back(out.back() + "_complement");
    }
  }
  return out;
}

StripePair deinterlaced(const Image8& frame, int slide_row) {
  return {one_field(frame, slide_row), one_field(frame, 1 - slide_row)};
}

Result<StripeStack> read_stripe_stack(const fs::path& folder, const Pattern& pattern, int projector_width,
                                      int projector_height, const ReadStripesOptions& options) {
  auto files = pictures_in(folder);
  if (!files) return files.error();
  const auto slides = static_cast<std::size_t>(pattern.slides);
  const bool interlaced = files->size() == 2 * slides;
  if (!interlaced && files->size() != 4 * slides) {
    return Error{folder.string() + " has " + number(files->size()) + " pictures; stripes on " +
                 number(slides) + " slides need " + number(4 * slides) +
                 " (each slide and its complement, along columns, then along rows), or " +
                 number(2 * slides) + " frames of an interlaced camera"};
  }
  StripeStack stack{projector_width, projector_height, pattern, {}, {}, interlaced};
  std::vector<Image8> pictures;
  for (std::size_t i = 0; i < files->size(); ++i) {
    if (options.on_picture && !options.on_picture(i, files->size())) return Error{"stopped"};
    auto picture = read_rgb((*files)[i]);
    if (!picture) return picture.error();
    if (!pictures.empty() &&
        (picture->width() != pictures[0].width() || picture->height() != pictures[0].height())) {
      return Error{(*files)[i].string() + " is of another size than the pictures before it"};
    }
    pictures.push_back(std::move(*picture));
  }
  std::vector<StripePair> pairs;
  for (std::size_t i = 0; i < pictures.size(); i += interlaced ? 1 : 2) {
    if (interlaced) {
      pairs.push_back(deinterlaced(pictures[i], first_row(options.field_order, 0)));
    } else {
      pairs.push_back({std::move(pictures[i]), std::move(pictures[i + 1])});
    }
  }
  for (std::size_t i = 0; i < pairs.size(); ++i)
    (i < slides ? stack.columns : stack.rows).push_back(std::move(pairs[i]));
  return stack;
}

Status write_stripe_view(const fs::path& folder, const StripeStack& stack) {
  const auto names = stripe_view_names(stack.pattern.slides, Scan::kProgressive);
  std::size_t at = 0;
  for (const auto* pairs : {&stack.columns, &stack.rows}) {
    for (const StripePair& pair : *pairs) {
      for (const Image8* picture : {&pair.lit, &pair.complement}) {
        if (Status written = write_png(folder / (names[at++] + ".png"), *picture); !written) return written;
      }
    }
  }
  return {};
}

Result<std::vector<Image8>> draw_stripe_slides(const Pattern& pattern, int projector_width,
                                               int projector_height, Scan scan, FieldOrder first) {
  if (pattern.stripes() > projector_width) {
    return Error{std::to_string(pattern.stripes()) + " stripes do not fit " +
                 std::to_string(projector_width) + " projector columns: ask for fewer"};
  }
  const Pattern rows = row_pattern(pattern, projector_width, projector_height);
  std::vector<Image8> out;
  for (const bool along_rows : {false, true}) {
    for (int slide = 0; slide < pattern.slides; ++slide) {
      const auto draw = [&](bool complement) {
        return along_rows ? draw_row_slide(rows, slide, complement, projector_width, projector_height)
                          : draw_slide(pattern, slide, complement, projector_width, projector_height);
      };
      Image8 lit = draw(false), other = draw(true);
      if (scan == Scan::kInterlaced) {
        for (int y = first_row(first, 1); y < projector_height; y += 2)
          std::copy_n(other.row(y), other.stride(), lit.row(y));
      }
      out.push_back(std::move(lit));
      if (scan != Scan::kInterlaced) out.push_back(std::move(other));
    }
  }
  return out;
}

Status write_stripe_slides(const fs::path& folder, const Pattern& pattern, int projector_width,
                           int projector_height, Scan scan, FieldOrder first) {
  const auto slides = draw_stripe_slides(pattern, projector_width, projector_height, scan, first);
  if (!slides) return slides.error();
  const auto names = stripe_view_names(pattern.slides, scan);
  for (std::size_t i = 0; i < slides->size(); ++i) {
    if (Status written = write_png(folder / (names[i] + ".png"), (*slides)[i]); !written) return written;
  }
  return {};
}

}  // namespace relievo
