// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/gray_stack.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numeric>
#include <optional>
#include <regex>
#include <string>
#include <utility>

#include "base/new_folder.h"
#include "capture/calibrate/pictures.h"
#include "capture/picture_file.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

/// A file and the slide it was taken under.
struct Capture {
  fs::path file;
  GraySlide slide;
};

std::optional<GraySlide> tag_of(const std::string& name) {
  static const std::regex pattern(R"(\[(\d{1,2})-(\d{1,2})-(\d{1,2})(_\d+)?\])");
  std::smatch match;
  if (!std::regex_search(name, match, pattern)) return std::nullopt;
  const int axis = std::stoi(match[1]), bit = std::stoi(match[2]), inverse = std::stoi(match[3]);
  if (axis > 1 || bit > 15 || inverse > 1) return std::nullopt;
  return GraySlide{GraySlide::Kind::kBit, axis == 0 ? GrayAxis::kColumns : GrayAxis::kRows, bit,
                   inverse == 1};
}

/// Whether one of two pictures is the brighter wherever they differ.
Result<bool> is_white_and_black(const fs::path& a, const fs::path& b) {
  auto first = read_rgb(a);
  if (!first) return first.error();
  auto second = read_rgb(b);
  if (!second) return second.error();
  if (first->size() != second->size()) return Error{a.string() + " and " + b.string() + " differ in size"};
  double sum = 0, distance = 0;
  for (std::size_t i = 0; i < first->size(); ++i) {
    const int d = int{first->data()[i]} - int{second->data()[i]};
    sum += d;
    distance += std::abs(d);
  }
  return std::fabs(sum) > 0.8 * distance;
}

Result<std::vector<Capture>> captures_of(const fs::path& folder, int width, int height) {
  auto files = pictures_in(folder);
  if (!files) return files.error();
  if (is_imported(folder))
    std::erase_if(*files, [](const fs::path& file) { return file.filename() == kImportedPicture; });
  std::vector<Capture> captures;
  for (const fs::path& file : *files) {
    if (const auto slide = tag_of(file.filename().string())) captures.push_back({file, *slide});
  }
  if (!captures.empty()) return captures;

  auto slides = gray_slides(width, height);
  const std::size_t bits_only = slides.size() - 2;
  if (files->size() != slides.size() && files->size() != bits_only) {
    return Error{folder.string() + " has " + std::to_string(files->size()) + " pictures; a projector of " +
                 std::to_string(width) + "x" + std::to_string(height) + " needs " +
                 std::to_string(bits_only) + " (each bit and its inverse, columns then rows), or " +
                 std::to_string(slides.size()) + " with white and black; is --projector right?"};
  }
  if (files->size() == slides.size()) {
    auto last = is_white_and_black((*files)[files->size() - 2], files->back());
    if (!last) return last.error();
    // The finest row bit, which is last where white and black come first, is dark as often as bright.
    if (!*last) std::rotate(slides.begin(), slides.end() - 2, slides.end());
  }
  for (std::size_t i = 0; i < files->size(); ++i) captures.push_back({(*files)[i], slides[i]});
  return captures;
}

double mean_of(const Image8& picture) {
  return std::accumulate(picture.data(), picture.data() + picture.size(), 0.0) /
         static_cast<double>(std::max<std::size_t>(1, picture.size()));
}

/// Pictures under a bit and under its inverse together are lit everywhere once.
Image8 sum_of(const Image8& a, const Image8& b) {
  Image8 out = a.clone();
  for (std::size_t i = 0; i < out.size(); ++i) {
    out.data()[i] = static_cast<std::uint8_t>(std::min(255, int{out.data()[i]} + int{b.data()[i]}));
  }
  return out;
}

/// Puts pictures where they belong and remembers what makes the scene's own picture.
class Builder {
 public:
  Builder(int projector_width, int projector_height) {
    stack_.projector_width = projector_width;
    stack_.projector_height = projector_height;
  }

  Status add(const Capture& capture) {
    auto rgb = read_rgb(capture.file);
    if (!rgb) return rgb.error();
    if (width_ == 0) {
      width_ = rgb->width();
      height_ = rgb->height();
    } else if (rgb->width() != width_ || rgb->height() != height_) {
      return Error{capture.file.string() + " is " + std::to_string(rgb->width()) + "x" +
                   std::to_string(rgb->height()) + ", the pictures before it " + std::to_string(width_) +
                   "x" + std::to_string(height_)};
    }
    const GraySlide& slide = capture.slide;
    if (slide.kind != GraySlide::Kind::kBit) {
      // White and black come in either order.
      if (stack_.picture.empty() || mean_of(*rgb) > mean_of(stack_.picture)) stack_.picture = std::move(*rgb);
      return {};
    }
    auto& pairs = slide.axis == GrayAxis::kColumns ? stack_.columns : stack_.rows;
    if (pairs.size() <= static_cast<std::size_t>(slide.bit))
      pairs.resize(static_cast<std::size_t>(slide.bit) + 1);
    GrayPair& pair = pairs[static_cast<std::size_t>(slide.bit)];
    Image8& place = slide.inverse ? pair.inverse : pair.lit;
    if (!place.empty()) return Error{capture.file.string() + ": a second picture of " + to_string(slide)};
    place = grey_of(*rgb);
    if (slide.axis == GrayAxis::kColumns && slide.bit == 0) {
      finest_ = finest_.empty() ? std::move(*rgb) : sum_of(finest_, *rgb);
    }
    return {};
  }

  Result<GrayStack> finish(const fs::path& folder) {
    for (const GrayAxis axis : {GrayAxis::kColumns, GrayAxis::kRows}) {
      auto& pairs = axis == GrayAxis::kColumns ? stack_.columns : stack_.rows;
      const int count = axis == GrayAxis::kColumns ? stack_.projector_width : stack_.projector_height;
      pairs.resize(std::max(pairs.size(), static_cast<std::size_t>(gray_bits(count))));
      for (std::size_t bit = 0; bit < pairs.size(); ++bit) {
        for (const bool inverse : {false, true}) {
          if (!(inverse ? pairs[bit].inverse : pairs[bit].lit).empty()) continue;
          const GraySlide missing{GraySlide::Kind::kBit, axis, static_cast<int>(bit), inverse};
          return Error{folder.string() + " has no picture of " + to_string(missing)};
        }
      }
    }
    if (stack_.picture.empty()) stack_.picture = std::move(finest_);
    return std::move(stack_);
  }

 private:
  GrayStack stack_;
  Image8 finest_;
  int width_ = 0, height_ = 0;
};

}  // namespace

bool is_imported(const fs::path& folder) {
  std::error_code ignored;
  return fs::exists(folder / kImportedColumns, ignored) && fs::exists(folder / kImportedRows, ignored);
}

Result<GrayStack> read_gray_stack(const fs::path& folder, int projector_width, int projector_height,
                                  const std::function<bool(std::size_t, std::size_t)>& on_picture) {
  auto captures = captures_of(folder, projector_width, projector_height);
  if (!captures) return captures.error();
  Builder builder(projector_width, projector_height);
  for (std::size_t i = 0; i < captures->size(); ++i) {
    if (on_picture && !on_picture(i, captures->size())) return Error{"stopped"};
    if (const Status added = builder.add((*captures)[i]); !added) return added.error();
  }
  return builder.finish(folder);
}

std::vector<GraySlide> flat_bits(const GrayStack& stack, const GrayDecodeOptions& options) {
  const auto change = [](const GrayPair& pair, std::size_t i) {
    return std::abs(int{pair.lit.data()[i]} - int{pair.inverse.data()[i]});
  };
  std::vector<int> contrast(static_cast<std::size_t>(stack.width()) *
                            static_cast<std::size_t>(stack.height()));
  for (const auto* pairs : {&stack.columns, &stack.rows})
    for (const GrayPair& pair : *pairs)
      for (std::size_t i = 0; i < contrast.size(); ++i) contrast[i] = std::max(contrast[i], change(pair, i));
  std::vector<GraySlide> out;
  for (const GrayAxis axis : {GrayAxis::kColumns, GrayAxis::kRows}) {
    const auto& pairs = axis == GrayAxis::kColumns ? stack.columns : stack.rows;
    for (std::size_t bit = 0; bit < pairs.size(); ++bit) {
      std::size_t lit = 0, flat = 0;
      for (std::size_t i = 0; i < contrast.size(); ++i) {
        if (contrast[i] < options.min_contrast) continue;
        ++lit;
        flat +=
            change(pairs[bit], i) < std::max<double>(options.min_difference, options.min_share * contrast[i]);
      }
      if (lit > 0 && 10 * flat > 9 * lit)
        out.push_back({GraySlide::Kind::kBit, axis, static_cast<int>(bit), false});
    }
  }
  return out;
}

std::string gray_slide_name(std::size_t number) {
  char name[32];
  std::snprintf(name, sizeof name, "gray_%02zu.png", number);
  return name;
}

Status write_gray_slides(const fs::path& folder, int projector_width, int projector_height,
                         const std::function<bool(std::size_t, std::size_t)>& on_slide) {
  const auto made = NewFolder::create(folder);
  if (!made) return made.error();
  const auto slides = gray_slides(projector_width, projector_height);
  for (std::size_t i = 0; i < slides.size(); ++i) {
    if (on_slide && !on_slide(i, slides.size()))
      return Error{"stopped: " + std::to_string(i) + " of " + std::to_string(slides.size()) +
                   " slides are in " + folder.string()};
    if (Status written = write_png(folder / gray_slide_name(i),
                                   draw_gray_slide(slides[i], projector_width, projector_height));
        !written) {
      return written;
    }
  }
  return {};
}

}  // namespace relievo
