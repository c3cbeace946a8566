// SPDX-License-Identifier: Apache-2.0
#include "capture/evaluate/pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "base/line_step.h"
#include "capture/evaluate/drawing.h"
#include "capture/reconstruct/field_difference.h"

namespace relievo {
namespace {

constexpr Colour kBackground{0.07F, 0.08F, 0.10F};
constexpr Colour kWrong{1, 0, 1};
constexpr int kLegendHeight = 44;

Image8 blank(int width, int height) {
  Image8 out(width, height, 3);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) set_pixel(out, x, y, kBackground);
  return out;
}

/// Between colours at equal distances, `at` in 0..1.
Colour ramp(const std::vector<Colour>& stops, float at) {
  const float place = std::clamp(at, 0.F, 1.F) * static_cast<float>(stops.size() - 1);
  const std::size_t i = std::min(static_cast<std::size_t>(place), stops.size() - 2);
  const float f = place - static_cast<float>(i);
  Colour out{};
  for (std::size_t c = 0; c < 3; ++c) out[c] = stops[i][c] + f * (stops[i + 1][c] - stops[i][c]);
  return out;
}
const std::vector<Colour>& rainbow() {
  static const std::vector<Colour> stops{{0.75F, 0.10F, 0.08F}, {0.95F, 0.45F, 0.10F}, {0.93F, 0.85F, 0.25F},
                                         {0.35F, 0.85F, 0.45F}, {0.15F, 0.70F, 0.85F}, {0.20F, 0.30F, 0.75F}};
  return stops;
}
const std::vector<Colour>& diverging() {
  static const std::vector<Colour> stops{{0.10F, 0.25F, 0.90F},
                                         {0.45F, 0.70F, 1.00F},
                                         {0.97F, 0.97F, 0.97F},
                                         {1.00F, 0.65F, 0.40F},
                                         {0.90F, 0.10F, 0.10F}};
  return stops;
}
const std::vector<Colour>& confidence() {
  static const std::vector<Colour> stops{{0.10F, 0.75F, 0.30F}, {0.90F, 0.85F, 0.20F}, {0.90F, 0.15F, 0.10F}};
  return stops;
}

struct Label {
  float at;  // 0..1 along the scale
  std::string text;
};

/// `picture` with a colour scale below.
Image8 with_legend(const Image8& picture, const std::vector<Colour>& stops,
                   const std::vector<Label>& labels) {
  const int width = picture.width();
  Image8 out = blank(width, picture.height() + kLegendHeight);
  std::copy_n(picture.data(), picture.size(), out.data());
  const int left = width / 8;
  const int right = width - left;
  const int top = picture.height() + 8;
  for (int x = left; x < right; ++x)
    for (int y = top; y < top + 12; ++y)
      set_pixel(out, x, y, ramp(stops, static_cast<float>(x - left) / static_cast<float>(right - left - 1)));
  cv::Mat canvas(out.height(), out.width(), CV_8UC3, out.data());
  for (const Label& label : labels) {
    constexpr double kScale = 0.4;
    const cv::Size size = cv::getTextSize(label.text, cv::FONT_HERSHEY_SIMPLEX, kScale, 1, nullptr);
    const int centre = left + static_cast<int>(label.at * static_cast<float>(right - left));
    cv::putText(canvas, label.text, {centre - size.width / 2, top + 28}, cv::FONT_HERSHEY_SIMPLEX, kScale,
                cv::Scalar(225, 225, 225), 1, cv::LINE_AA);
  }
  return out;
}

std::string text(const char* format, double value) {
  std::array<char, 48> out{};
  std::snprintf(out.data(), out.size(), format, value);
  return out.data();
}

/// The surface's triangles, each corner with a colour of its own, and vertices of no triangle as points.
Image8 draw_surface(const Surface& surface, const Rig& rig,
                    const std::function<Colour(std::size_t)>& colour_of) {
  Image8 out = blank(rig.camera.width, rig.camera.height);
  std::vector<Vec2f> pixel(surface.positions.size());
  std::vector<Colour> colours(surface.positions.size());
  for (std::size_t v = 0; v < pixel.size(); ++v) {
    const Vec2f& uv = surface.texture_coordinates[v];
    pixel[v] = {uv[0] * static_cast<float>(out.width()) - 0.5F,
                uv[1] * static_cast<float>(out.height()) - 0.5F};
    colours[v] = colour_of(v);
    set_pixel(out, static_cast<int>(std::lround(pixel[v][0])), static_cast<int>(std::lround(pixel[v][1])),
              colours[v]);
  }
  for (const Triangle& t : surface.triangles) {
    const Vec2f &a = pixel[t[0]], &b = pixel[t[1]], &c = pixel[t[2]];
    const float area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    if (area == 0) continue;
    const auto [left, right] = std::minmax({a[0], b[0], c[0]});
    const auto [top, bottom] = std::minmax({a[1], b[1], c[1]});
    for (int y = static_cast<int>(std::ceil(top)); static_cast<float>(y) <= bottom; ++y) {
      for (int x = static_cast<int>(std::ceil(left)); static_cast<float>(x) <= right; ++x) {
        const float px = static_cast<float>(x);
        const float py = static_cast<float>(y);
        const float wb = ((px - a[0]) * (c[1] - a[1]) - (py - a[1]) * (c[0] - a[0])) / area;
        const float wc = ((b[0] - a[0]) * (py - a[1]) - (b[1] - a[1]) * (px - a[0])) / area;
        if (wb < -1e-4F || wc < -1e-4F || wb + wc > 1.0001F) continue;
        Colour mixed{};
        for (std::size_t k = 0; k < 3; ++k)
          mixed[k] = (1 - wb - wc) * colours[t[0]][k] + wb * colours[t[1]][k] + wc * colours[t[2]][k];
        set_pixel(out, x, y, mixed);
      }
    }
  }
  return out;
}

}  // namespace

Image8 draw_field(const CapturedFrame& frame, bool complement) {
  if (frame.scan == Scan::kProgressive) return (complement ? frame.complement : frame.picture).clone();
  Image8 out = frame.picture.clone();
  for (int y = 0; y < out.height(); ++y) {
    const int from = std::min((y / 2) * 2 + (complement ? 1 : 0), out.height() - 1);
    std::copy_n(frame.picture.row(from), out.stride(), out.row(y));
  }
  return out;
}

Image8 draw_difference(const CapturedFrame& frame, const Rig& rig) {
  Differencer differencer(rig.colour_matrix);
  WorkerPool pool(1);
  DifferenceImage image;
  differencer.difference(frame, pool, image);
  Image8 out = blank(rig.camera.width, rig.camera.height);
  const int step = line_step_px(frame.scan);
  float largest = 1;
  for (const float d : image.values) largest = std::max(largest, std::fabs(d));
  const float unit = 0.5F / (0.7F * largest);
  for (int y = 0; y < out.height(); ++y) {
    const float* d = image.line(std::min(y / step, image.lines - 1));
    for (int x = 0; x < image.width; ++x) {
      set_pixel(out, x, y,
                {0.5F + unit * d[x], 0.5F + unit * d[image.width + x], 0.5F + unit * d[2 * image.width + x]});
    }
  }
  return out;
}

Image8 draw_boundaries(const CapturedFrame& frame, const Surface& surface, const Pattern& pattern,
                       int slide) {
  Image8 out = dimmed(frame.picture);
  const auto light = [](Primary p) {
    return Colour{p & 1 ? 1.F : 0.F, p & 2 ? 1.F : 0.F, p & 4 ? 1.F : 0.F};
  };
  const int step = line_step_px(frame.scan);
  const int lines = (out.height() + step - 1) / step;
  for (const GridPoint& at : surface.grid) {
    if (at.interpolated) continue;
    const int row = at.line % lines * step;
    const int x = static_cast<int>(std::floor(at.column_px + 0.5F));
    for (int dy = 0; dy < step; ++dy) {
      for (int side = 0; side < 2; ++side) {
        set_pixel(out, x - 2 + side, row + dy, light(pattern.colour(at.boundary, slide)));
        set_pixel(out, x + side, row + dy, light(pattern.colour(at.boundary + 1, slide)));
      }
    }
  }
  return out;
}

Image8 draw_depth(const Surface& surface, const Rig& rig) {
  std::vector<float> depths;
  for (const Vec3f& p : surface.positions) depths.push_back(p[2]);
  std::sort(depths.begin(), depths.end());
  // Few wrong points must not take the colours from all the others.
  const float near = depths.empty() ? 0 : depths[depths.size() / 200];
  const float far = depths.empty() ? 1 : depths[depths.size() - 1 - depths.size() / 200];
  const float range = std::max(far - near, 1e-3F);
  const Image8 picture = draw_surface(
      surface, rig, [&](std::size_t v) { return ramp(rainbow(), (surface.positions[v][2] - near) / range); });
  return with_legend(picture, rainbow(),
                     {{0, text("%.3f m", near)},
                      {0.5F, text("%.3f m", near + 0.5F * range)},
                      {1, text("%.3f m", near + range)}});
}

Image8 draw_normals(const Surface& surface, const Rig& rig) {
  return draw_surface(surface, rig, [&](std::size_t v) {
    const Vec3f& n = surface.normals[v];
    return Colour{0.5F + 0.5F * n[0], 0.5F - 0.5F * n[1], 0.5F - 0.5F * n[2]};
  });
}

Image8 draw_sigma(const Surface& surface, const Rig& rig) {
  constexpr float kBest_m = 2e-5F;
  constexpr float kOctaves = 6.644F;  // up to 2 mm
  const Image8 picture = draw_surface(surface, rig, [&](std::size_t v) {
    const float sigma = surface.sigmas_m.empty() ? 0 : surface.sigmas_m[v];
    return sigma > 0 ? ramp(confidence(), std::log2(sigma / kBest_m) / kOctaves) : Colour{0.4F, 0.4F, 0.45F};
  });
  return with_legend(picture, confidence(), {{0, "0.02 mm"}, {0.5F, "0.2 mm"}, {1, "2 mm"}});
}

Image8 draw_errors(const CapturedFrame& frame, const Judgement& judgement, float range) {
  Image8 out = dimmed(frame.picture);
  const int step = line_step_px(frame.scan);
  const auto dot = [&](const JudgedVertex& v, int from, int to, const Colour& colour) {
    const int x = static_cast<int>(std::lround(v.column_px));
    const int y = static_cast<int>(std::lround(v.row_px));
    for (int dy = 0; dy < step; ++dy)
      for (int dx = from; dx <= to; ++dx) set_pixel(out, x + dx, y + dy, colour);
  };
  for (const JudgedVertex& v : judgement.vertices)
    if (v.right) dot(v, -1, 1, ramp(diverging(), 0.5F + 0.5F * v.error / range));
  for (const JudgedVertex& v : judgement.vertices)
    if (!v.right) dot(v, -2, 2, kWrong);
  const double mm = 1e3 * static_cast<double>(range);
  return with_legend(out, diverging(),
                     {{0, text("%.2f mm/m nearer", mm)}, {0.5F, "0"}, {1, text("%.2f mm/m farther", mm)}});
}

Image8 draw_completeness(const CapturedFrame& frame, const Judgement& judgement) {
  constexpr Colour kFound{0.15F, 0.85F, 0.35F};
  constexpr Colour kMissed{1, 0.15F, 0.1F};
  Image8 out = dimmed(frame.picture);
  const int step = line_step_px(frame.scan);
  for (const bool found : {true, false}) {
    for (const JudgedBoundary& b : judgement.boundaries) {
      if (b.found != found) continue;
      const int x = static_cast<int>(std::lround(b.column_px));
      for (int dy = 0; dy < step; ++dy) {
        set_pixel(out, x, b.row + dy, found ? kFound : kMissed);
        if (!found) set_pixel(out, x + 1, b.row + dy, kMissed);
      }
    }
  }
  for (const JudgedVertex& v : judgement.vertices) {
    if (v.right) continue;
    for (int dy = 0; dy < step; ++dy)
      for (int dx = -2; dx <= 2; ++dx)
        set_pixel(out, static_cast<int>(std::lround(v.column_px)) + dx,
                  static_cast<int>(std::lround(v.row_px)) + dy, kWrong);
  }
  return out;
}

}  // namespace relievo
