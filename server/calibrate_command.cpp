// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>

#include "capture/calibrate/board.h"
#include "server/calibrate_commands.h"
#include "server/commands.h"

namespace relievo {

CLI::Option* add_board_option(CLI::App& app, std::string& board, const std::string& help) {
  return app.add_option("--board", board, help)->check([](const std::string& text) {
    const auto parsed = parse_board(text);
    return parsed ? std::string() : parsed.error().message;
  });
}

Command calibrate_command() {
  return {"calibrate", "Calibrate the rig from captures: writes rig.yaml", [](CLI::App& app) {
            app.require_subcommand(1);
            CLI::App* geometry = app.add_subcommand(
                "geometry",
                "Lenses and poses of camera and projector, from views of a chessboard or ChArUco board");
            CLI::App* colour =
                app.add_subcommand("colour", "The colour matrix, from captures of a white target");
            CLI::App* example = app.add_subcommand(
                "example", "Write simulated captures to try the other two on, with the truth");
            CLI::App* board = app.add_subcommand("board", "Write a board to print, as a picture");
            for (CLI::App* verb : {geometry, colour, example, board}) verb->fallthrough();
            auto run_geometry = define_calibrate_geometry(*geometry);
            auto run_colour = define_calibrate_colour(*colour);
            auto run_example = define_calibrate_example(*example);
            auto run_board = define_calibrate_board(*board);
            return [=](StopSignal& stop) {
              if (board->parsed()) return run_board(stop);
              if (example->parsed()) return run_example(stop);
              return geometry->parsed() ? run_geometry(stop) : run_colour(stop);
            };
          }};
}

}  // namespace relievo
