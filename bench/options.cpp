// SPDX-License-Identifier: Apache-2.0
#include "bench/options.h"

#include <CLI/CLI.hpp>

#include "cli/checks.h"
#include "codec/geometry_profile.h"
#include "codec/texture_codec.h"

namespace relievo::bench {

void add_source_option(CLI::App& app, std::string& source) {
  app.add_option("--source", source, "sim:SCENE[,KEY=VALUE...] or take:DIR")->capture_default_str();
}

void add_threads_option(CLI::App& app, int& threads) {
  app.add_option("--threads", threads, "That reconstruct")->check(whole_number(1, 64))->capture_default_str();
}

void add_codec_options(CLI::App& app, std::string& geometry, std::string& texture) {
  app.add_option("--geometry", geometry, "As of serve")
      ->check([](const std::string& name) {
        EncodeOptions unused;
        return set_geometry_profile(name, unused) ? "" : "give " + geometry_profile_names();
      })
      ->capture_default_str();
  app.add_option("--texture", texture, "As of serve")
      ->check([](const std::string& name) {
        return texture_codec_named(name) ? "" : "give " + texture_codec_names();
      })
      ->capture_default_str();
}

void add_json_option(CLI::App& app, bool& json) {
  app.add_flag("--json", json, "Print JSON");
}

void add_repeat_options(CLI::App& app, Repeats& repeats, unsigned least_frames) {
  app.add_option("--frames", repeats.frames, "Frames to code")
      ->check(whole_number(least_frames, 10000))
      ->capture_default_str();
  app.add_option("--rounds", repeats.rounds, "Times that each row of the table codes all of them")
      ->check(whole_number(1, 1000))
      ->capture_default_str();
}

}  // namespace relievo::bench
