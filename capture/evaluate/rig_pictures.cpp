// SPDX-License-Identifier: Apache-2.0
#include "base/line_step.h"
#include "capture/evaluate/drawing.h"
#include "capture/evaluate/pictures.h"
#include "capture/evaluate/rig_check.h"

namespace relievo {
namespace {

constexpr Colour kClipped{1, 0.1F, 0.1F};
constexpr Colour kDark{0.1F, 0.25F, 0.75F};
constexpr Colour kFound{0.15F, 0.75F, 0.35F};
constexpr Colour kMissed{0.95F, 0.2F, 0.15F};
constexpr Colour kOrder{1, 0, 1};
constexpr float kTint = 0.55F;  // of a mark over the frame

/// Mixed with what is there.
void tint(Image8& picture, int x, int y, const Colour& colour) {
  Colour mixed{};
  for (std::size_t c = 0; c < 3; ++c) {
    const float before = static_cast<float>(picture.row(y)[3 * x + static_cast<int>(c)]) / 255.F;
    mixed[c] = kTint * colour[c] + (1 - kTint) * before;
  }
  set_pixel(picture, x, y, mixed);
}

}  // namespace

Image8 draw_exposure(const CapturedFrame& captured) {
  Image8 out = draw_field(captured, false);
  const View8 slide = captured.slide_field(), complement = captured.complement_field();
  const int step = line_step_px(captured.scan);
  for (int y = 0; y < out.height(); ++y) {
    const int line = std::min({y / step, slide.height - 1, complement.height - 1});
    for (int x = 0; x < out.width(); ++x) {
      const std::uint8_t* a = slide.row(line) + 3 * static_cast<std::ptrdiff_t>(x);
      const std::uint8_t* b = complement.row(line) + 3 * static_cast<std::ptrdiff_t>(x);
      const int most = std::max({a[0], a[1], a[2], b[0], b[1], b[2]});
      if (most >= kClippedLevel) set_pixel(out, x, y, kClipped);
      if (most < kDarkLevel) set_pixel(out, x, y, kDark);
    }
  }
  return out;
}

Image8 draw_coverage(const CapturedFrame& decoded, const RigCheck& check) {
  Image8 out = dimmed(decoded.picture);
  const int step = line_step_px(decoded.scan);
  for (int y = 0; y < out.height() && !check.cover.empty(); ++y) {
    const std::uint8_t* cover = check.cover.row(std::min(y / step, check.cover.height() - 1));
    for (int x = 0; x < out.width(); ++x)
      if (cover[x] > 0) tint(out, x, y, cover[x] == 2 ? kFound : kMissed);
  }
  return out;
}

Image8 draw_order(const CapturedFrame& decoded, const RigCheck& check) {
  Image8 out = dimmed(decoded.picture);
  const int step = line_step_px(decoded.scan);
  for (const OrderError& error : check.order_errors) {
    const int x = static_cast<int>(std::lround(error.column_px));
    for (int dy = 0; dy < step; ++dy)
      for (int dx = -2; dx <= 2; ++dx) set_pixel(out, x + dx, error.line * step + dy, kOrder);
  }
  return out;
}

}  // namespace relievo
