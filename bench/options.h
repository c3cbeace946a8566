// SPDX-License-Identifier: Apache-2.0
// Options that several suites have, each told in one place. What they fill must outlive the parsing.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace relievo::bench {

void add_source_option(CLI::App& app, std::string& source);
void add_threads_option(CLI::App& app, int& threads);
/// How surface and texture are sent, as of serve.
void add_codec_options(CLI::App& app, std::string& geometry, std::string& texture);
void add_json_option(CLI::App& app, bool& json);

/// Of suites that code the same frames again and again.
struct Repeats {
  int frames = 20;
  int rounds = 3;
};
void add_repeat_options(CLI::App& app, Repeats& repeats, unsigned least_frames = 1);

}  // namespace relievo::bench
