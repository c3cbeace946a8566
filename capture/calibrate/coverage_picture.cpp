// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <opencv2/imgproc.hpp>

#include "base/counted.h"
#include "capture/calibrate/coverage.h"

namespace relievo {
namespace {

constexpr int kHeight = 720;  // of both pictures
constexpr int kFooter = 150;  // below them, for the tilts
constexpr int kGap = 8;
const cv::Scalar kMissing(92, 36, 36), kSeen(30, 64, 44), kBack(24, 24, 24), kText(235, 235, 235);
const cv::Scalar kBefore(120, 170, 140), kLast(255, 215, 90);

int panel_width(const PinholeModel& lens) {
  return kHeight * lens.width / lens.height;
}

void write(cv::Mat& onto, const std::string& text, cv::Point at, double size = 0.55) {
  cv::putText(onto, text, at, cv::FONT_HERSHEY_SIMPLEX, size, kText, 1, cv::LINE_AA);
}

void draw_corners(cv::Mat& panel, const std::vector<std::vector<CornerSight>>& views, bool projector,
                  double scale) {
  for (std::size_t v = 0; v < views.size(); ++v) {
    const bool last = v + 1 == views.size();
    for (const CornerSight& c : views[v]) {
      const Vec2d& px = projector ? c.projector_px : c.camera_px;
      cv::circle(panel, cv::Point2d(scale * px[0], scale * px[1]), last ? 5 : 3, last ? kLast : kBefore,
                 cv::FILLED, cv::LINE_AA);
    }
  }
}

/// A board in perspective: its `side` (left, right, upper, lower) is drawn shorter, as farther away.
void draw_tilt(cv::Mat& onto, cv::Point centre, std::size_t side, bool seen) {
  constexpr int kHalf = 34, kFar = 20;
  std::array<cv::Point, 4> corners = {cv::Point(-kHalf, -kHalf), cv::Point(kHalf, -kHalf),
                                      cv::Point(kHalf, kHalf), cv::Point(-kHalf, kHalf)};
  constexpr std::array<std::array<std::size_t, 2>, 4> kOfSide = {{{0, 3}, {1, 2}, {0, 1}, {2, 3}}};
  for (const std::size_t i : kOfSide[side]) (side < 2 ? corners[i].y : corners[i].x) *= kFar / double(kHalf);
  for (cv::Point& corner : corners) corner += centre;
  cv::fillConvexPoly(onto, corners, seen ? kSeen : kMissing, cv::LINE_AA);
  for (std::size_t i = 0; i < 4; ++i) cv::line(onto, corners[i], corners[(i + 1) % 4], kText, 1, cv::LINE_AA);
}

}  // namespace

Image8 Coverage::draw_seen() const {
  const int left = panel_width(camera_), right = panel_width(projector_);
  Image8 out(left + kGap + right, kHeight, 3);
  cv::Mat whole(out.height(), out.width(), CV_8UC3, out.data());
  whole.setTo(kBack);

  cv::Mat camera = whole(cv::Rect(0, 0, left, kHeight));
  for (int i = 0; i < 9; ++i) {
    const int x0 = left * (i % 3) / 3, x1 = left * (i % 3 + 1) / 3;
    const int y0 = kHeight * (i / 3) / 3, y1 = kHeight * (i / 3 + 1) / 3;
    const cv::Rect cell(x0 + 1, y0 + 1, x1 - x0 - 2, y1 - y0 - 2);
    camera(cell).setTo(cells_[static_cast<std::size_t>(i)] ? kSeen : kMissing);
  }
  draw_corners(camera, added_, false, double(kHeight) / camera_.height);

  cv::Mat projector = whole(cv::Rect(left + kGap, 0, right, kHeight));
  projector.setTo(cv::Scalar(44, 44, 52));
  draw_corners(projector, added_, true, double(kHeight) / projector_.height);
  return out;
}

Image8 Coverage::draw() const {
  Image8 seen = draw_seen();
  Image8 out(seen.width(), kHeight + kFooter, 3);
  cv::Mat whole(out.height(), out.width(), CV_8UC3, out.data());
  whole.setTo(kBack);
  cv::Mat(kHeight, seen.width(), CV_8UC3, seen.data()).copyTo(whole.rowRange(0, kHeight));
  write(whole, "camera: red parts have not seen the board", {12, 24});
  write(whole, "projector", {panel_width(camera_) + kGap + 12, 24});

  static const std::array<const char*, 4> kSides = {"left", "right", "upper", "lower"};
  for (std::size_t side = 0; side < 4; ++side) {
    const int x = 70 + 150 * static_cast<int>(side);
    draw_tilt(whole, {x, kHeight + 60}, side, tilts_[side]);
    write(whole, std::string(kSides[side]) + " side away", {x - 58, kHeight + 125}, 0.5);
  }
  write(whole, counted(added_.size(), "view"), {70 + 150 * 4, kHeight + 65}, 0.8);
  return out;
}

}  // namespace relievo
