// SPDX-License-Identifier: Apache-2.0
// Processor time and memory of this process while something runs.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace relievo::bench {

double resident_mb();           // now
std::int64_t process_cpu_ns();  // of all threads so far

struct Usage {
  std::vector<double> total_cores;   // a value a window
  std::vector<double> client_cores;  // of which the clients'
  std::vector<double> server_cores;  // and all else
  std::vector<double> resident_mb;
  std::map<std::string, double> thread_cores;  // on average, by the threads' names
};

/// Samples from creation to finish(), on a thread of its own.
class UsageMeter {
 public:
  /// `client_cpu_ns` is called on that thread: processor time so far of what is no part of the server.
  explicit UsageMeter(std::function<std::int64_t()> client_cpu_ns);
  ~UsageMeter();
  UsageMeter(const UsageMeter&) = delete;
  UsageMeter& operator=(const UsageMeter&) = delete;

  Usage finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace relievo::bench
