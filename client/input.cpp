// SPDX-License-Identifier: Apache-2.0
#include "client/input.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>

#include "base/stream.h"
#include "codec/mcap_records.h"

namespace relievo {

namespace {

/// By its first bytes, which are read of a file alone: a pipe would wait for who writes it.
bool is_recording(const std::string& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) return false;
  std::array<char, mcap::kMagic.size()> start{};
  std::ifstream in(path, std::ios::binary);
  return in.read(start.data(), start.size()) &&
         std::equal(start.begin(), start.end(), mcap::kMagic.begin(),
                    [](char c, std::uint8_t magic) { return static_cast<std::uint8_t>(c) == magic; });
}

}  // namespace

Result<bool> is_file(const std::string& input) {
  std::error_code ignored;
  const bool may_be_stream = valid_stream_name(input) && !input.ends_with(".mcap");
  if (may_be_stream) return is_recording(input);
  if (std::filesystem::exists(input, ignored)) return true;
  return Error{"there is no file " + input};
}

void check_stream(const std::string& name) {
  if (!valid_stream_name(name)) throw CLI::ValidationError("stream", "'" + name + "' cannot name a stream");
  if (name.ends_with(".mcap") && is_recording(name))
    throw CLI::ValidationError(
        "stream", name + " is a recording, and this is of live streams: `relievo play` makes one of it");
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
