// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <opencv2/imgproc.hpp>

#include "capture/calibrate/geometry.h"

namespace relievo {
namespace {

constexpr double kLonger = 200;  // arrows, than the residuals are
constexpr int kHeight = 720;     // of each half

/// A colour a view, well apart for those that follow each other.
cv::Scalar colour_of(std::size_t view) {
  static const std::array<cv::Scalar, 8> kColours = {cv::Scalar{255, 99, 71}, {60, 179, 255},  {90, 220, 90},
                                                     {255, 200, 40},          {220, 110, 255}, {64, 224, 208},
                                                     {255, 160, 200},         {190, 190, 190}};
  return kColours[view % kColours.size()];
}

cv::Mat panel(const Geometry& geometry, bool projector) {
  const PinholeModel& lens = projector ? geometry.projector : geometry.camera;
  const double scale = static_cast<double>(kHeight) / lens.height;
  cv::Mat out(kHeight, static_cast<int>(lens.width * scale), CV_8UC3, cv::Scalar(24, 24, 24));
  const auto at = [&](double x, double y) { return cv::Point2d(x * scale, y * scale); };
  for (const CornerResidual& r : geometry.residuals) {
    const Vec2d from = projector ? r.projector_px : r.camera_px;
    const Vec2d off = projector ? r.projector_off_px : r.camera_off_px;
    const cv::Point2d start = at(from[0], from[1]);
    const cv::Point2d end = start + kLonger * scale * cv::Point2d(off[0], off[1]);
    cv::circle(out, start, 2, colour_of(r.view), cv::FILLED, cv::LINE_AA);
    cv::line(out, start, end, colour_of(r.view), 1, cv::LINE_AA);
  }
  const cv::Point2d centre = at(lens.cx(), lens.cy());
  cv::drawMarker(out, centre, {255, 255, 255}, cv::MARKER_CROSS, 16, 1, cv::LINE_AA);
  char text[96];
  std::snprintf(text, sizeof text, "%s: RMS %.3f px; arrows %.0f times as long",
                projector ? "projector" : "camera", projector ? geometry.projector_rms : geometry.camera_rms,
                kLonger);
  cv::putText(out, text, {12, 24}, cv::FONT_HERSHEY_SIMPLEX, 0.55, {255, 255, 255}, 1, cv::LINE_AA);
  int row = 48;
  for (std::size_t v = 0; v < geometry.reports.size(); ++v) {
    const ViewReport& report = geometry.reports[v];
    const double rms = projector ? report.projector_rms : report.camera_rms;
    if (report.used) {
      std::snprintf(text, sizeof text, "%.60s  %.3f px", report.name.c_str(), rms);
    } else {
      std::snprintf(text, sizeof text, "%.60s  left out", report.name.c_str());
    }
    cv::putText(out, text, {12, row}, cv::FONT_HERSHEY_SIMPLEX, 0.45, colour_of(v), 1, cv::LINE_AA);
    row += 18;
  }
  return out;
}

}  // namespace

Image8 draw_residuals(const Geometry& geometry) {
  const cv::Mat left = panel(geometry, false), right = panel(geometry, true);
  Image8 out(left.cols + 8 + right.cols, kHeight, 3);
  cv::Mat whole(out.height(), out.width(), CV_8UC3, out.data());
  whole.setTo(cv::Scalar(90, 90, 90));
  left.copyTo(whole(cv::Rect(0, 0, left.cols, kHeight)));
  right.copyTo(whole(cv::Rect(left.cols + 8, 0, right.cols, kHeight)));
  return out;
}

}  // namespace relievo
