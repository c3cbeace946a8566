// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/board.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <regex>

namespace relievo {
namespace {

constexpr const char* kUsage =
    " is no board such as chessboard:9x7:75mm (inner corners across and down, side of a square) or "
    "charuco:10x8:30mm:22mm:5X5_100 (squares, their side, the markers' side and dictionary)";

/// OpenCV's predefined dictionaries come in fours of a marker's size, by the number of markers.
std::optional<int> dictionary_number(const std::string& name) {
  static const std::map<std::string, int> others = {{"DICT_ARUCO_ORIGINAL", cv::aruco::DICT_ARUCO_ORIGINAL},
                                                    {"DICT_APRILTAG_16h5", cv::aruco::DICT_APRILTAG_16h5},
                                                    {"DICT_APRILTAG_25h9", cv::aruco::DICT_APRILTAG_25h9},
                                                    {"DICT_APRILTAG_36h10", cv::aruco::DICT_APRILTAG_36h10},
                                                    {"DICT_APRILTAG_36h11", cv::aruco::DICT_APRILTAG_36h11}};
  if (const auto found = others.find(name); found != others.end()) return found->second;
  static const std::regex pattern(R"(DICT_([4-7])X\1_(50|100|250|1000))");
  std::smatch match;
  if (!std::regex_match(name, match, pattern)) return std::nullopt;
  const std::string count = match[2];
  const int size = std::stoi(match[1]), of = count == "50" ? 0 : count == "100" ? 1 : count == "250" ? 2 : 3;
  return cv::aruco::DICT_4X4_50 + 4 * (size - 4) + of;
}

/// The white squares, row by row from the second of the first row, carry markers 0, 1, 2, ...
cv::Ptr<cv::aruco::CharucoBoard> charuco_of(const Board& board) {
  return cv::aruco::CharucoBoard::create(
      board.columns + 1, board.rows + 1, static_cast<float>(board.square_m),
      static_cast<float>(board.marker_m),
      cv::aruco::getPredefinedDictionary(dictionary_number(board.dictionary).value_or(0)));
}

constexpr const char* kLength = R"((\d{1,6}(?:\.\d{0,6})?|\.\d{1,6})(mm|cm|m))";

double length_m(const std::string& number, const std::string& unit) {
  return std::atof(number.c_str()) * (unit == "mm" ? 0.001 : unit == "cm" ? 0.01 : 1);
}

// Of a square that somebody prints. Others are a wrong unit: all that is calibrated by it looks good, in
// kilometres.
constexpr double kLeastSquare_m = 0.0001, kMostSquare_m = 1;

Status check_square(const std::string& text, double square_m) {
  if (square_m >= kLeastSquare_m && square_m <= kMostSquare_m) return {};
  return Error{text + ": a square's side must be 0.1 mm to 1 m: is its unit right?"};
}

Result<Board> parse_charuco(const std::string& text) {
  static const std::regex pattern(std::string(R"(charuco:(\d{1,3})[xX](\d{1,3}):)") + kLength + ":" +
                                  kLength + "(:[A-Za-z0-9_]{1,32})?");
  std::smatch match;
  if (!std::regex_match(text, match, pattern)) return Error{"'" + text + "'" + kUsage};
  Board board{std::stoi(match[1]) - 1, std::stoi(match[2]) - 1, length_m(match[3], match[4]),
              length_m(match[5], match[6]), "DICT_4X4_50"};
  if (match[7].matched) board.dictionary = match[7].str().substr(1);
  if (board.dictionary.rfind("DICT_", 0) != 0) board.dictionary = "DICT_" + board.dictionary;
  if (board.columns < 2 || board.rows < 2) return Error{text + ": at least 3 x 3 squares are needed"};
  if (const Status square = check_square(text, board.square_m); !square) return square.error();
  if (!(board.marker_m > 0 && board.marker_m < board.square_m)) {
    return Error{text + ": a marker's side must be above 0 and below the square's"};
  }
  const auto number = dictionary_number(board.dictionary);
  if (!number) {
    return Error{text + ": no dictionary " + board.dictionary +
                 "; OpenCV's are 4X4_50, _100, _250, _1000, the same of 5X5, 6X6 and 7X7, ARUCO_ORIGINAL and "
                 "APRILTAG_16h5, 25h9, 36h10, 36h11"};
  }
  const int markers = (board.columns + 1) * (board.rows + 1) / 2;
  const int known = cv::aruco::getPredefinedDictionary(*number)->bytesList.rows;
  if (markers > known) {
    return Error{text + ": the board has " + std::to_string(markers) + " markers, " + board.dictionary +
                 " only " + std::to_string(known) + ": use a larger dictionary"};
  }
  return board;
}

/// The least distance between neighbours that are both seen; 0 where there are none.
double least_spacing(const std::vector<cv::Point2f>& corners, const std::vector<int>& index,
                     const Board& board) {
  std::map<int, cv::Point2f> at;
  for (std::size_t i = 0; i < index.size(); ++i) at[index[i]] = corners[i];
  double least = std::numeric_limits<double>::infinity();
  for (const auto& [i, place] : at) {
    const auto look = [&, place = place](int j) {  // clang before 16 captures no binding by itself
      if (const auto found = at.find(j); found != at.end())
        least = std::min(least, cv::norm(found->second - place));
    };
    if (i % board.columns + 1 < board.columns) look(i + 1);
    look(i + board.columns);
  }
  return std::isfinite(least) ? least : 0;
}

/// Sub-pixel, in a window that stays well inside what is plain black and white around a corner.
std::vector<BoardCorner> refined(const cv::Mat& picture, std::vector<cv::Point2f> corners,
                                 const std::vector<int>& index, const Board& board) {
  const double spacing = least_spacing(corners, index, board);
  double plain = spacing / 4;
  if (board.charuco()) plain = std::min(plain, 0.45 * spacing * (1 - board.marker_m / board.square_m));
  const int window = std::clamp(static_cast<int>(plain), 2, 15);
  // Edges as sharp as a pixel draw a corner towards pixel centres by some hundredths; a little blur halves
  // that.
  cv::Mat smooth;
  cv::GaussianBlur(picture, smooth, {0, 0}, board.charuco() ? 0.7 : 1);
  cv::cornerSubPix(smooth, corners, {window, window}, {-1, -1},
                   {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-4});
  std::vector<BoardCorner> out;
  for (std::size_t i = 0; i < corners.size(); ++i) out.push_back({index[i], {corners[i].x, corners[i].y}});
  return out;
}

std::vector<BoardCorner> find_chessboard(const cv::Mat& picture, const cv::Mat& stretched,
                                         const Board& board) {
  const cv::Size size(board.columns, board.rows);
  std::vector<cv::Point2f> corners;
  if (!cv::findChessboardCorners(
          stretched, size, corners,
          cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FAST_CHECK) &&
      !cv::findChessboardCornersSB(stretched, size, corners, cv::CALIB_CB_NORMALIZE_IMAGE)) {
    return {};
  }
  std::vector<int> index;
  for (int i = 0; i < board.corners(); ++i) index.push_back(i);
  return refined(picture, std::move(corners), index, board);
}

std::vector<BoardCorner> find_charuco(const cv::Mat& picture, const cv::Mat& stretched, const Board& board) {
  const auto charuco = charuco_of(board);
  std::vector<std::vector<cv::Point2f>> markers, rejected;
  std::vector<int> ids;
  cv::aruco::detectMarkers(stretched, charuco->dictionary, markers, ids,
                           cv::aruco::DetectorParameters::create(), rejected);
  if (ids.empty()) return {};
  cv::aruco::refineDetectedMarkers(stretched, charuco, markers, ids, rejected);
  std::vector<cv::Point2f> corners;
  std::vector<int> index;
  cv::aruco::interpolateCornersCharuco(markers, ids, stretched, charuco, corners, index);
  if (corners.empty()) return {};
  return refined(picture, std::move(corners), index, board);
}

}  // namespace

Result<Board> parse_board(const std::string& text) {
  if (text.rfind("charuco", 0) == 0) return parse_charuco(text);
  static const std::regex pattern(std::string(R"(chessboard:(\d{1,3})[xX](\d{1,3}):)") + kLength);
  std::smatch match;
  if (!std::regex_match(text, match, pattern)) return Error{"'" + text + "'" + kUsage};
  Board board{std::stoi(match[1]), std::stoi(match[2]), length_m(match[3], match[4])};
  if (board.columns < 3 || board.rows < 3) return Error{text + ": at least 3 x 3 inner corners are needed"};
  if (const Status square = check_square(text, board.square_m); !square) return square.error();
  return board;
}

std::vector<BoardCorner> find_board(const ImageF& grey, const Board& board) {
  try {
    const cv::Mat picture(grey.height(), grey.width(), CV_32FC1,
                          const_cast<float*>(grey.data()));  // read only
    cv::Mat stretched;                                       // boards are often dim
    cv::normalize(picture, stretched, 0, 255, cv::NORM_MINMAX, CV_8U);
    return board.charuco() ? find_charuco(picture, stretched, board)
                           : find_chessboard(picture, stretched, board);
  } catch (const cv::Exception&) {  // a picture too small or too odd for the detector: no board
    return {};
  }
}

Image8 draw_board(const Board& board, int square_px) {
  Image8 out((board.columns + 1) * square_px, (board.rows + 1) * square_px, 1);
  for (int y = 0; y < out.height(); ++y) {
    for (int x = 0; x < out.width(); ++x) {
      out.row(y)[x] = (x / square_px + y / square_px) % 2 == 0 ? 0 : 255;
    }
  }
  if (!board.charuco()) return out;
  const auto charuco = charuco_of(board);
  cv::Mat canvas(out.height(), out.width(), CV_8UC1, out.data());
  const int side = static_cast<int>(std::lround(square_px * board.marker_m / board.square_m));
  int id = 0;
  for (int row = 0; row <= board.rows; ++row) {
    for (int column = 0; column <= board.columns; ++column) {
      if ((row + column) % 2 == 0) continue;
      cv::Mat marker;
      charuco->dictionary->drawMarker(id++, side, marker);
      marker.copyTo(canvas(cv::Rect(column * square_px + (square_px - side) / 2,
                                    row * square_px + (square_px - side) / 2, side, side)));
    }
  }
  return out;
}

}  // namespace relievo
