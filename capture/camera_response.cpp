// SPDX-License-Identifier: Apache-2.0
#include "capture/camera_response.h"

#include <cmath>

#include "base/fit_image.h"

namespace relievo {

CameraResponse::CameraResponse(double gamma) {
  for (std::size_t i = 0; i < light_.size(); ++i) {
    light_[i] = static_cast<float>(255 * std::pow(static_cast<double>(i) / 255, gamma));
    levels_[i] = static_cast<std::uint8_t>(light_[i] + 0.5F);
  }
  if (gamma == 1) return;
  values_.resize(255 * kParts + 1);
  for (std::size_t i = 0; i < values_.size(); ++i) {
    const double light = static_cast<double>(i) / (255.0 * kParts);
    values_[i] = static_cast<std::uint8_t>(std::lround(255 * std::pow(light, 1 / gamma)));
  }
}

void CameraResponse::light_of(const std::uint8_t* values, int samples, float* light) const {
  if (is_straight()) {
    for (int i = 0; i < samples; ++i) light[i] = values[i];
  } else {
    for (int i = 0; i < samples; ++i) light[i] = light_[values[i]];
  }
}

void CameraResponse::straighten(const CapturedFrame& captured, WorkerPool& pool, CapturedFrame& out) const {
  out.take_heading(captured);
  const auto whole = [&](const Image8& from, Image8& to) {
    fit_image(from.width(), from.height(), from.channels(), to);
    const int samples = from.width() * from.channels();
    pool.for_ranges(from.height(), [&](int begin, int end, int) {
      for (int y = begin; y < end; ++y)
        std::transform(from.row(y), from.row(y) + samples, to.row(y),
                       [this](std::uint8_t value) { return levels_[value]; });
    });
  };
  whole(captured.picture, out.picture);
  whole(captured.complement, out.complement);
}

Image8 CameraResponse::straightened(const Image8& captured) const {
  Image8 out = captured.clone();
  if (is_straight()) return out;
  std::transform(out.data(), out.data() + out.size(), out.data(),
                 [this](std::uint8_t value) { return levels_[value]; });
  return out;
}

}  // namespace relievo
