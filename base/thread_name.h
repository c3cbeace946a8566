// SPDX-License-Identifier: Apache-2.0
// Names of threads, for who looks at a running program from outside: top -H, perf, a debugger.
#pragma once

namespace relievo {

/// Of the calling thread; up to 15 characters. Threads that it starts have the same until they are named.
void name_this_thread(const char* name);

}  // namespace relievo
