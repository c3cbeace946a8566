// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/white_target.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace relievo {
namespace {

constexpr std::size_t kMinPixels = 200;
constexpr double kBright = 0.95;  // quantile of the light that counts as fully lit
constexpr double kShare = 0.5;

/// Grey levels that the projector adds from black to white.
cv::Mat light_of(const std::vector<ColourCapture>& captures) {
  const Image8* white = nullptr;
  const Image8* black = nullptr;
  for (const ColourCapture& c : captures) {
    if (c.colour == 7) white = &c.picture;
    if (c.colour == 0) black = &c.picture;
  }
  cv::Mat out(white->height(), white->width(), CV_8UC1);
  for (std::size_t i = 0; i < out.total(); ++i) {
    int sum = 0;
    for (std::size_t c = 0; c < 3; ++c) sum += int{white->data()[3 * i + c]} - int{black->data()[3 * i + c]};
    out.data[i] = static_cast<std::uint8_t>(std::clamp(sum / 3, 0, 255));
  }
  return out;
}

int bright_level(const cv::Mat& light) {
  std::vector<std::uint8_t> values(light.data, light.data + light.total());
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(kBright * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

cv::Mat segment(const cv::Mat& light) {
  cv::Mat smooth, mask;
  cv::medianBlur(light, smooth, 5);  // no hole or bridge from noise
  // A small target is darker than the 95th percentile of the whole picture: its own brightest part counts.
  double highest = 0;
  cv::minMaxLoc(smooth, nullptr, &highest);
  const double bright = std::max<double>(bright_level(smooth), 0.7 * highest);
  cv::threshold(smooth, mask, std::max(4.0, kShare * bright), 1, cv::THRESH_BINARY);
  cv::Mat labels, stats, centres;
  const int count = cv::connectedComponentsWithStats(mask, labels, stats, centres, 4);
  int largest = 0;
  for (int i = 1; i < count; ++i) {
    if (largest == 0 || stats.at<int>(i, cv::CC_STAT_AREA) > stats.at<int>(largest, cv::CC_STAT_AREA))
      largest = i;
  }
  if (largest == 0) return cv::Mat::zeros(light.size(), CV_8UC1);
  mask = (labels == largest) / 255;
  const int rim =
      std::clamp(static_cast<int>(0.03 * std::sqrt(stats.at<int>(largest, cv::CC_STAT_AREA))), 2, 25);
  cv::Mat out;
  cv::erode(mask, out, cv::Mat::ones(2 * rim + 1, 2 * rim + 1, CV_8UC1), {-1, -1}, 1, cv::BORDER_CONSTANT, 1);
  return out;
}

}  // namespace

Result<WhiteTarget> find_white_target(const std::vector<ColourCapture>& captures,
                                      const std::optional<Roi>& roi) {
  const Image8& picture = captures.front().picture;
  cv::Mat mask;
  if (roi) {
    if (roi->x < 0 || roi->y < 0 || roi->width < 1 || roi->height < 1 ||
        roi->width > picture.width() - roi->x || roi->height > picture.height() - roi->y) {
      return Error{"the region given is not inside the pictures of " + std::to_string(picture.width()) + "x" +
                   std::to_string(picture.height())};
    }
    mask = cv::Mat::zeros(picture.height(), picture.width(), CV_8UC1);
    mask(cv::Rect(roi->x, roi->y, roi->width, roi->height)).setTo(1);
  } else {
    try {
      mask = segment(light_of(captures));
    } catch (const cv::Exception& e) {
      return Error{"the white target cannot be found: " + e.err};
    }
  }
  WhiteTarget out;
  out.mask.assign(mask.data, mask.data + mask.total());
  out.pixels = static_cast<std::size_t>(std::count(out.mask.begin(), out.mask.end(), 1));
  if (out.pixels < kMinPixels && roi) {
    return Error{"the region given has " + std::to_string(out.pixels) + " pixels, " +
                 std::to_string(kMinPixels) + " are needed: give a larger one"};
  }
  if (out.pixels < kMinPixels) {
    return Error{"no white target is found: " + std::to_string(out.pixels) +
                 " pixels are lit by the projector, " + std::to_string(kMinPixels) +
                 " are needed; point the camera at a white wall or sheet, or say where it is with "
                 "--roi X,Y,WIDTH,HEIGHT"};
  }
  const cv::Rect box = cv::boundingRect(mask);
  out.box = {box.x, box.y, box.width, box.height};
  return out;
}

}  // namespace relievo
