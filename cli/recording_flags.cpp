// SPDX-License-Identifier: Apache-2.0
#include "cli/recording_flags.h"

#include <CLI/CLI.hpp>

#include "cli/quantities.h"

namespace relievo {
namespace {

constexpr double kSyncAtEnd = -1;

Result<double> parse_sync_s(const std::string& text) {
  if (text == "chunk") return 0.0;
  if (text == "none") return kSyncAtEnd;
  const auto seconds = parse_duration_s(text);
  if (!seconds) return Error{"'" + text + "' is neither chunk, none nor a duration such as 5s"};
  return *seconds;
}

}  // namespace

std::shared_ptr<RecordingTexts> add_recording_flags(CLI::App& app) {
  auto texts = std::make_shared<RecordingTexts>();
  app.add_option("--split-size", texts->split_size,
                 "Begin a new file, FILE_000001.mcap, where one is as large, e.g. 2GB")
      ->type_name("SIZE")
      ->check(byte_count());
  app.add_option("--split-every", texts->split_every, "or as long, e.g. 10min")
      ->type_name("TIME")
      ->check(duration());
  app.add_option("--keep-size", texts->keep_size,
                 "Remove the oldest of these files while all are larger, or the disk is full, e.g. 100GB")
      ->type_name("SIZE")
      ->check(byte_count());
  app.add_option("--keep-for", texts->keep_for, "Remove those that ended longer ago, e.g. 7d")
      ->type_name("TIME")
      ->check(duration());
  app.add_option(
         "--sync", texts->sync,
         "What is written is put on the disk with each chunk, of half a second (chunk, the default), every "
         "TIME, or when the system does (none): what a power loss may take")
      ->type_name("chunk|TIME|none")
      ->check(sync_policy());
  return texts;
}

ValueCheck sync_policy() {
  return [](const std::string& text) {
    const auto value = parse_sync_s(text);
    return value ? std::string() : value.error().message;
  };
}

RecordingTexts merged(const RecordingTexts& flags, RecordingTexts config) {
  for (const auto text : {&RecordingTexts::split_size, &RecordingTexts::keep_size,
                          &RecordingTexts::split_every, &RecordingTexts::keep_for, &RecordingTexts::sync})
    if (!(flags.*text).empty()) config.*text = flags.*text;
  return config;
}

Result<RecordingOptions> recording_options(const RecordingTexts& texts) {
  RecordingOptions out;
  Status all;
  const auto set = [&](std::string RecordingTexts::*text, auto parse, auto& field) {
    if ((texts.*text).empty()) return;
    const auto value = parse(texts.*text);
    if (value)
      field = *value;
    else
      all = value.error();
  };
  set(&RecordingTexts::split_size, parse_bytes, out.segments.split_bytes);
  set(&RecordingTexts::split_every, parse_duration_s, out.segments.split_s);
  set(&RecordingTexts::keep_size, parse_bytes, out.segments.keep_bytes);
  set(&RecordingTexts::keep_for, parse_duration_s, out.segments.keep_s);
  set(&RecordingTexts::sync, parse_sync_s, out.sync_s);
  if (!all) return all.error();
  if (out.segments.keep() && !out.segments.split())
    return Error{"--keep-size and --keep-for remove whole files: give --split-size or --split-every too"};
  return out;
}

}  // namespace relievo
