// SPDX-License-Identifier: Apache-2.0
#include "client/commands.h"

int main(int argc, char** argv) {
  using namespace relievo;
  return run_program("relievo", "Views, records and plays live 3D video",
                     {streams_command(), stats_command(), record_command(), play_command(), info_command(),
                      recover_command(), export_command(), convert_command(), web_command(), keys_command(),
                      doctor_command(), shot_command(), measure_command(), ros2_command()},
                     argc, argv);
}
