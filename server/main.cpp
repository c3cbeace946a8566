// SPDX-License-Identifier: Apache-2.0
#include "server/commands.h"

int main(int argc, char** argv) {
  using namespace relievo;
  return run_program("relievo-server", "Captures 3D video with one camera and one projector, and serves it",
                     {serve_command(), simulate_command(), reconstruct_command(), evaluate_command(),
                      calibrate_command(), import_command(), pattern_command(), plan_command(),
                      project_command(), devices_command(), capture_command()},
                     argc, argv);
}
