// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>

#include "server/calibrate_commands.h"
#include "server/commands.h"

namespace relievo {

Command calibrate_command() {
  return {"calibrate", "Calibrate the rig from captures: writes rig.yaml", [](CLI::App& app) {
            app.require_subcommand(1);
            CLI::App* geometry = app.add_subcommand(
                "geometry", "Lenses and poses of camera and projector, from views of a chessboard");
            CLI::App* colour =
                app.add_subcommand("colour", "The colour matrix, from captures of a white target");
            CLI::App* example = app.add_subcommand(
                "example", "Write simulated captures to try the other two on, with the truth");
            for (CLI::App* verb : {geometry, colour, example}) verb->fallthrough();
            auto run_geometry = define_calibrate_geometry(*geometry);
            auto run_colour = define_calibrate_colour(*colour);
            auto run_example = define_calibrate_example(*example);
            return [=](StopSignal& stop) {
              if (example->parsed()) return run_example(stop);
              return geometry->parsed() ? run_geometry(stop) : run_colour(stop);
            };
          }};
}

}  // namespace relievo
