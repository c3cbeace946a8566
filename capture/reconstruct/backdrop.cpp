// SPDX-License-Identifier: Apache-2.0
#include "capture/reconstruct/backdrop.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

namespace relievo {
namespace {

constexpr int kSide_px = 3;       // a look is the mean of so many pixels on either side
constexpr float kSame_px = 0.5F;  // a boundary so near to where it was has not moved
constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
constexpr int kDark = 30;  // of a look's six values in all: noise is no difference

}  // namespace

Backdrop::Backdrop(int boundaries, int lines)
    : boundaries_(static_cast<std::size_t>(boundaries)),
      seen_(boundaries_ * static_cast<std::size_t>(lines), Seen{kNone, {}, {}}) {}

std::optional<Backdrop::Look> Backdrop::look_at(View8 field, int line, float column_px) {
  const int centre = static_cast<int>(column_px + 0.5F);
  if (centre < kSide_px || centre + kSide_px >= field.width) return std::nullopt;
  const std::uint8_t* p = field.row(line) + static_cast<std::ptrdiff_t>(3) * centre;
  Look out;
  for (int c = 0; c < 3; ++c) {
    int left = 0;
    int right = 0;
    for (int i = 1; i <= kSide_px; ++i) {
      left += p[c - 3 * i];
      right += p[c + 3 * i];
    }
    out[static_cast<std::size_t>(c)] = static_cast<std::uint8_t>(left / kSide_px);
    out[static_cast<std::size_t>(c) + 3] = static_cast<std::uint8_t>(right / kSide_px);
  }
  return out;
}

void Backdrop::remember(const SlideFieldView& view, int line, int boundary, float column_px) {
  const auto look = look_at(view.field, line, column_px);
  if (!look) return;
  Seen& s = seen_[static_cast<std::size_t>(line) * boundaries_ + static_cast<std::size_t>(boundary)];
  const auto slide = static_cast<std::size_t>(view.slide);
  if (!stands(line, boundary, column_px)) s.has = {};  // the other slide's is of another place
  s.column_px = column_px;
  s.has[slide] = true;
  s.look[slide] = *look;
}

float Backdrop::pitch_px(int line, int boundary) const {
  const float here = column_px(line, boundary);
  const float next =
      boundary + 1 < static_cast<int>(boundaries_) ? column_px(line, boundary + 1) - here : kNone;
  if (!std::isnan(next)) return std::fabs(next);
  return boundary > 0 ? std::fabs(here - column_px(line, boundary - 1)) : kNone;
}

bool Backdrop::stands(int line, int boundary, float column_px) const {
  return std::fabs(seen(line, boundary).column_px - column_px) < kSame_px;
}

std::optional<float> Backdrop::difference(const SlideFieldView& view, int line, int boundary,
                                          float column_px) const {
  const Seen& s = seen(line, boundary);
  const auto slide = static_cast<std::size_t>(view.slide);
  if (!s.has[slide]) return std::nullopt;
  const auto now = look_at(view.field, line, column_px);
  if (!now) return std::nullopt;
  int apart = 0;
  int most = kDark;
  for (std::size_t i = 0; i < now->size(); ++i) {
    apart += std::abs((*now)[i] - s.look[slide][i]);
    most += std::max((*now)[i], s.look[slide][i]);
  }
  return static_cast<float>(apart) / static_cast<float>(most);
}

}  // namespace relievo
