// SPDX-License-Identifier: Apache-2.0
// The verbs of `relievo`, one file each; main.cpp lists them.
#pragma once

#include "cli/program.h"

namespace relievo {

Command streams_command();
Command stats_command();
Command record_command();
Command play_command();
Command info_command();
Command recover_command();
Command export_command();
Command convert_command();
Command web_command();
Command keys_command();
Command doctor_command();
Command shot_command();
Command measure_command();
Command ros2_command();

}  // namespace relievo
