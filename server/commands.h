// SPDX-License-Identifier: Apache-2.0
// The verbs of relievo-server, one file each.
#pragma once

#include "cli/program.h"

namespace relievo {

Command serve_command();
Command simulate_command();
Command reconstruct_command();
Command evaluate_command();
Command import_command();
Command pattern_command();
Command plan_command();
Command project_command();
Command calibrate_command();
Command devices_command();
Command capture_command();

}  // namespace relievo
