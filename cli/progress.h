// SPDX-License-Identifier: Apache-2.0
// A progress line on stderr with rate and time left, for anything that takes over a second.
#pragma once

#include <cstdint>
#include <string>

namespace relievo {

/// Draws nothing where stderr is no terminal, where only errors are logged (-q), and in the first second. One
/// thread.
class Progress {
 public:
  /// `total` 0: not known, so no bar and no time left.
  Progress(std::string label, std::string unit, std::uint64_t total = 0);
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  ~Progress();  // as finish()

  /// `note` is appended, e.g. "3 lost". Cheap: draws at most ten times a second.
  void update(std::uint64_t done, const std::string& note = {});
  /// Wipes the line.
  void finish();

 private:
  std::string label_;
  std::string unit_;
  std::uint64_t total_;
  std::int64_t start_ns_;
  std::int64_t drawn_ns_ = 0;
  bool enabled_;
};

/// The line drawn, without terminal codes: "export  [#####     ] 50/100 frames  25.0/s  2 s left  note".
std::string progress_line(const std::string& label, const std::string& unit, std::uint64_t done,
                          std::uint64_t total, double elapsed_s, const std::string& note);

}  // namespace relievo
