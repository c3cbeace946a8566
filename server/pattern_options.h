// SPDX-License-Identifier: Apache-2.0
// Which pattern: the options that pattern, project and plan share.
#pragma once

#include <string>

#include "base/pattern.h"
#include "base/result.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace relievo {

struct PatternOptions {
  std::string file;  // an existing pattern.yaml; empty: made of what follows
  std::string scheme = "complementary";
  int base = 6;
  int slides = 2;
  int first = 0;
  std::string path = "clear";
  int stripes = 90;
};

/// Adds --pattern, --base, --slides, --path, --first, --stripes and --scheme, and returns --pattern.
/// `options` must outlive the parsing.
CLI::Option* add_pattern_options(CLI::App& app, PatternOptions& options);

/// The pattern asked for. Fails where the file or the code does not exist.
Result<Pattern> pattern_of(const PatternOptions& options);

/// Throws the CLI::ValidationError of options that ask for a code that there is not; files are read later.
void check_pattern_options(const PatternOptions& options);

/// Fails where the stripes do not fit the projector's columns.
Status fits_projector(const Pattern& pattern, int projector_width);

}  // namespace relievo
