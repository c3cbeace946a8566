// SPDX-License-Identifier: Apache-2.0
// What FILE|STREAM names, for verbs that take either.
#pragma once

#include <string>
#include <vector>

#include "base/result.h"

namespace CLI {
class App;
}

namespace relievo {

/// Whether it is a file, else a live stream. Where a stream may be called so, only a file that begins as a
/// recording does is one (`./name` is a file in any case). Fails where it can be neither.
Result<bool> is_file(const std::string& input);

/// For CLI::App::final_callback, of what can only be a live stream: it is wrong usage where no stream is
/// called so, or where it is a recording by its name, too.
void check_stream(const std::string& name);

/// Options that say nothing of the other kind of input.
struct OptionsOfInputs {
  std::vector<std::string> of_files, of_streams;
};
/// For CLI::App::final_callback: one that was given for the other kind is wrong usage, not to be ignored.
void check_given(const CLI::App& app, const std::string& input, const OptionsOfInputs& options);

}  // namespace relievo
