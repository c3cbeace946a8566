// SPDX-License-Identifier: Apache-2.0
// What a recording made on request is doing: said by who makes it and by the gateway.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace relievo {

enum class RecordingActivity : std::uint8_t { kOff, kRecording, kFailed };

/// "off", "recording" or "failed".
inline std::string_view to_string(RecordingActivity activity) {
  switch (activity) {
    case RecordingActivity::kOff:
      return "off";
    case RecordingActivity::kRecording:
      return "recording";
    case RecordingActivity::kFailed:
      return "failed";
  }
  return "unknown";
}

struct RecordingState {
  RecordingActivity activity = RecordingActivity::kOff;
  std::string file;               // its name in the folder, or the last one's; empty: there was none yet
  std::uint64_t frames = 0;       // written
  std::uint64_t lost = 0;         // that should be in it and are not
  std::uint64_t bytes = 0;        // of samples written
  std::uint64_t whole_bytes = 0;  // of its file: whole chunks, which can be read already; 0: none yet
  std::uint64_t room_bytes = 0;   // that its disk still takes, when last looked at
  std::int64_t started_ns = 0;    // UTC, when it was asked for; 0: there was none yet
  double pre_roll_s = 0;          // how much of what came before is kept for the next
  std::string message;            // for a person: why it failed, or what is still to be done
};

}  // namespace relievo
