// SPDX-License-Identifier: Apache-2.0
// --split-size, --split-every, --keep-size, --keep-for and --sync: of `relievo record` and of `serve
// --record`.
#pragma once

#include <memory>
#include <string>

#include "base/recording_options.h"
#include "base/result.h"
#include "cli/checks.h"

namespace CLI {
class App;
}

namespace relievo {

/// As given, on the command line or in a configuration; empty: not given.
struct RecordingTexts {
  std::string split_size, keep_size;  // quantities, "2GB"
  std::string split_every, keep_for;  // "10min"
  std::string sync;                   // "chunk", "none" or a duration

  bool operator==(const RecordingTexts&) const = default;
};

/// Checked and filled while parsing.
std::shared_ptr<RecordingTexts> add_recording_flags(CLI::App& app);

/// What is wrong with --sync, or nothing.
ValueCheck sync_policy();

/// Of `flags` what is given, else of `config`.
RecordingTexts merged(const RecordingTexts& flags, RecordingTexts config);

/// Fails where something is malformed, or old files are to go but none ever ends.
Result<RecordingOptions> recording_options(const RecordingTexts& texts);

}  // namespace relievo
