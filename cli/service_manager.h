// SPDX-License-Identifier: Apache-2.0
// What the service manager that started this process, systemd, is told of it; nothing where none did, and
// what it has no room for is left out: nobody waits. Any thread.
#pragma once

#include <string>

namespace relievo {

/// It can be used now: what waits for the service may start.
void tell_ready();
/// One line for `systemctl status`; keeps the watchdog (WatchdogSec=) quiet where `alive`.
void tell_state(const std::string& line, bool alive);
/// It ends, having been asked to.
void tell_stopping();

}  // namespace relievo
