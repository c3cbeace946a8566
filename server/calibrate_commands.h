// SPDX-License-Identifier: Apache-2.0
// The verbs of `relievo-server calibrate`.
#pragma once

#include <functional>
#include <string>

#include "base/result.h"
#include "cli/stop_signal.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace relievo {

/// Each adds its options to its own CLI::App and returns what runs where it is chosen.
std::function<Status(StopSignal&)> define_calibrate_geometry(CLI::App& app);
std::function<Status(StopSignal&)> define_calibrate_colour(CLI::App& app);
std::function<Status(StopSignal&)> define_calibrate_example(CLI::App& app);
std::function<Status(StopSignal&)> define_calibrate_board(CLI::App& app);

/// Adds --board; what parse_board() refuses is wrong usage.
CLI::Option* add_board_option(CLI::App& app, std::string& board, const std::string& help);

}  // namespace relievo
