// SPDX-License-Identifier: Apache-2.0
#include "cli/service_manager.h"

#include <systemd/sd-daemon.h>

namespace relievo {

void tell_ready() {
  sd_notify(0, "READY=1");
}

void tell_state(const std::string& line, bool alive) {
  sd_notify(0, ("STATUS=" + line + (alive ? "\nWATCHDOG=1" : "")).c_str());
}

void tell_stopping() {
  sd_notify(0, "STOPPING=1");
}

}  // namespace relievo
