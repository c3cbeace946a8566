// SPDX-License-Identifier: Apache-2.0
#include "client/input.h"

#include <CLI/CLI.hpp>
#include <filesystem>

#include "base/stream.h"

namespace relievo {

Result<bool> is_file(const std::string& input) {
  std::error_code ignored;
  const bool may_be_stream = valid_stream_name(input) && !input.ends_with(".mcap");
  if (may_be_stream && std::filesystem::is_directory(input, ignored)) return false;
  if (std::filesystem::exists(input, ignored)) return true;
  return may_be_stream ? Result<bool>(false) : Error{"there is no file " + input};
}

void check_given(const CLI::App& app, const std::string& input, const OptionsOfInputs& options) {
  const auto file = is_file(input);
  if (!file) return;  // which is a failure, and not of its usage
  for (const std::string& name : *file ? options.of_streams : options.of_files)
    if (app.count(name) > 0)
      throw CLI::ValidationError(name, *file ? "is of live streams, and " + input + " is a recording"
                                             : "is of recordings, and " + input + " is a live stream");
}

}  // namespace relievo
