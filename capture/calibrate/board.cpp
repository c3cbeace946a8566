// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/board.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <regex>

namespace relievo {
namespace {

/// Half the side of the window for a corner's sub-pixel position: well inside the squares around it.
int refine_window(const std::vector<cv::Point2f>& corners, const Board& board) {
  double shortest = 1e9;
  for (int i = 0; i < board.corners(); ++i) {
    const auto at = [&](int j) { return corners[static_cast<std::size_t>(j)]; };
    if (i % board.columns + 1 < board.columns) shortest = std::min(shortest, cv::norm(at(i) - at(i + 1)));
    if (i / board.columns + 1 < board.rows)
      shortest = std::min(shortest, cv::norm(at(i) - at(i + board.columns)));
  }
  return std::clamp(static_cast<int>(shortest / 4), 2, 15);
}

}  // namespace

Result<Board> parse_board(const std::string& text) {
  static const std::regex pattern(R"(chessboard:(\d{1,3})[xX](\d{1,3}):([0-9.]{1,12})(mm|cm|m))");
  std::smatch match;
  if (text.rfind("charuco", 0) == 0) {
    return Error{
        "ChArUco boards are not built in (Debian's OpenCV has them in libopencv-contrib-dev only): "
        "use a chessboard, e.g. chessboard:9x7:75mm"};
  }
  if (!std::regex_match(text, match, pattern)) {
    return Error{
        text + " is no board such as chessboard:9x7:75mm (inner corners across and down, side of a square)"};
  }
  Board board{std::stoi(match[1]), std::stoi(match[2]), std::atof(match[3].str().c_str())};
  board.square_m *= match[4] == "mm" ? 0.001 : match[4] == "cm" ? 0.01 : 1;
  if (board.columns < 3 || board.rows < 3) return Error{text + ": at least 3 x 3 inner corners are needed"};
  if (!(board.square_m > 0)) return Error{text + ": a square's side must be above 0"};
  return board;
}

std::optional<std::vector<Vec2d>> find_board(const ImageF& grey, const Board& board) {
  try {
    const cv::Mat picture(grey.height(), grey.width(), CV_32FC1,
                          const_cast<float*>(grey.data()));  // read only
    cv::Mat stretched;                                       // boards are often dim
    cv::normalize(picture, stretched, 0, 255, cv::NORM_MINMAX, CV_8U);
    const cv::Size size(board.columns, board.rows);
    std::vector<cv::Point2f> corners;
    if (!cv::findChessboardCorners(
            stretched, size, corners,
            cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FAST_CHECK) &&
        !cv::findChessboardCornersSB(stretched, size, corners, cv::CALIB_CB_NORMALIZE_IMAGE)) {
      return std::nullopt;
    }
    const int window = refine_window(corners, board);
    cv::cornerSubPix(picture, corners, {window, window}, {-1, -1},
                     {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-4});
    std::vector<Vec2d> out;
    for (const cv::Point2f& c : corners) out.push_back({c.x, c.y});
    return out;
  } catch (const cv::Exception&) {  // a picture too small or too odd for the detector: no board
    return std::nullopt;
  }
}

}  // namespace relievo
