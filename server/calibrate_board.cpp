// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "base/json_text.h"
#include "capture/calibrate/board.h"
#include "capture/calibrate/pictures.h"
#include "cli/checks.h"
#include "server/calibrate_commands.h"

namespace relievo {
namespace {

struct Options {
  std::string board;
  std::string out;
  int dpi = 300;
  bool json = false;
};

/// The squares with a white margin of one square, which detectors need.
Image8 with_margin(const Image8& squares, int margin) {
  Image8 out(squares.width() + 2 * margin, squares.height() + 2 * margin, 1);
  std::fill_n(out.data(), out.size(), std::uint8_t{255});
  for (int y = 0; y < squares.height(); ++y)
    std::copy_n(squares.row(y), squares.width(), out.row(y + margin) + margin);
  return out;
}

Status run(const Options& options) {
  const auto board = parse_board(options.board);
  if (!board) return board.error();
  constexpr double kInch_m = 0.0254;
  constexpr double kLeastDots = 10, kMostDots = 32000;
  const double square_dots = std::round(board->square_m / kInch_m * options.dpi);
  const double least_dots = board->charuco() ? square_dots * board->marker_m / board->square_m : square_dots;
  const double largest = std::max(board->columns, board->rows) + 3.0;
  const bool too_large = square_dots * largest > kMostDots;
  if (too_large || least_dots < kLeastDots) {
    return Error{options.board + " at " + std::to_string(options.dpi) + " dots an inch is too " +
                 (too_large ? "large: give a smaller" : "small: give a larger") +
                 " --dpi, so that squares and markers have 10 dots or more and the picture 32000 at most"};
  }
  const auto square_px = static_cast<int>(square_dots);
  const Image8 picture = with_margin(draw_board(*board, square_px), square_px);
  if (const Status written = write_png(options.out, picture); !written) return written;
  const double dots_per_mm = square_px / board->square_m / 1000;
  const double width_mm = picture.width() / dots_per_mm, height_mm = picture.height() / dots_per_mm;
  if (options.json) {
    const nlohmann::json json = {{"picture", options.out},
                                 {"board", options.board},
                                 {"width_mm", width_mm},
                                 {"height_mm", height_mm},
                                 {"inner_corners", {board->columns, board->rows}}};
    std::puts(json_text(json).c_str());
    return {};
  }
  std::printf("%s: print it %.1f x %.1f mm large, margin included, on something flat and matt,\n",
              options.out.c_str(), width_mm, height_mm);
  std::printf("then measure a row of squares: each must be %.2f mm, or give what it is to --board\n",
              1000 * board->square_m);
  return {};
}

}  // namespace

std::function<Status(StopSignal&)> define_calibrate_board(CLI::App& app) {
  auto o = std::make_shared<Options>();
  add_board_option(app, o->board,
                   "chessboard:COLUMNSxROWS:SIDE (inner corners) or "
                   "charuco:COLUMNSxROWS:SIDE:MARKER[:DICTIONARY] (squares)")
      ->required();
  app.add_option("-o,--out", o->out, "The PNG to write")->check(png_name())->required();
  app.add_option("--dpi", o->dpi, "Dots an inch")->check(CLI::Range(20, 2400))->capture_default_str();
  app.add_flag("--json", o->json, "Print what was written as JSON");
  return [o](StopSignal&) { return run(*o); };
}

}  // namespace relievo
