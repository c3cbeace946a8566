// SPDX-License-Identifier: Apache-2.0
// What a live calibration sees, simulated: a board that is held still at one pose after another while the
// projector shows the stripes along columns and rows in turn, and a white sheet under the code's colours.
#pragma once

#include <memory>
#include <string>

#include "capture/source/field_source.h"

namespace relievo {

/// "sim:board[:BOARD][,key=value...]": BOARD as parse_board() has it, chessboard:9x7:25mm where not given;
/// keys as for other scenes. Each pose takes 20 frames of the period: 14 at rest, 6 on the way to the next.
/// Frames show slide 1, 2, ... along columns, then along rows. `rest` is what follows "sim:board".
Result<std::unique_ptr<FieldSource>> open_board(const std::string& rest, const SourceOptions& options);

/// "sim:sheet[,key=value...]": a white sheet at rest; frames show black, red, green and blue, each with its
/// complement. `rest` is what follows "sim:sheet".
Result<std::unique_ptr<FieldSource>> open_sheet(const std::string& rest, const SourceOptions& options);

/// Whether those know all that is said; they are not opened.
Status check_board(const std::string& rest);
Status check_sheet(const std::string& rest);

}  // namespace relievo
