// SPDX-License-Identifier: Apache-2.0
#include "server/pattern_options.h"

#include <CLI/CLI.hpp>

#include "capture/pattern/bcsl.h"
#include "capture/pattern/repeating.h"
#include "capture/rig_file.h"
#include "cli/checks.h"

namespace relievo {
namespace {

constexpr int kMostSlides = 2;  // that are decoded (Reconstructor::create())

}  // namespace

CLI::Option* add_pattern_options(CLI::App& app, PatternOptions& o) {
  auto* file = app.add_option("--pattern", o.file, "An existing pattern.yaml instead of a new pattern");
  for (auto* option :
       {app.add_option("--base", o.base, "Colours: 3 to 6"),
        app.add_option("--slides", o.slides, "Slides shown in turn: 1 or 2; one-slide has 1")
            ->check(whole_number(1, kMostSlides)),
        app.add_option("--path", o.path,
                       "Which path through the code: clear, whose boundaries flip many channels, or paper, "
                       "the published one; one-slide has its own")
            ->check(CLI::IsMember({"clear", "paper"})),
        app.add_option("--first", o.first, "First stripe within that path"),
        app.add_option("--stripes", o.stripes, "Stripes over the projector's width")}) {
    option->capture_default_str()->excludes(file);
  }
  app.add_option("--scheme", o.scheme, "What is projected in turn, see below")
      ->check([](const std::string& name) { return scheme_named(name) ? "" : "give " + scheme_names(); })
      ->type_name("NAME")
      ->capture_default_str()
      ->excludes(file);
  return file;
}

Result<Pattern> pattern_of(const PatternOptions& options) {
  if (!options.file.empty()) {
    auto pattern = read_pattern(options.file);
    if (pattern && pattern->slides > kMostSlides)
      return Error{options.file + " has " + std::to_string(pattern->slides) +
                   " slides, and two frames in a row decode one or two: use a pattern with slides: 2"};
    return pattern;
  }
  return make_scheme_pattern(scheme_named(options.scheme).value_or(Scheme::kComplementary), options.base,
                             options.slides, options.first, options.stripes,
                             code_path_named(options.path).value_or(CodePath::kClear));
}

void check_pattern_options(const PatternOptions& options) {
  if (!options.file.empty()) return;
  if (const auto pattern = pattern_of(options); !pattern) throw CLI::ValidationError(pattern.error().message);
}

Status fits_projector(const Pattern& pattern, int projector_width) {
  if (pattern.stripes() <= projector_width) return {};
  return Error{std::to_string(pattern.stripes()) + " stripes do not fit " + std::to_string(projector_width) +
               " projector columns: ask for fewer with --stripes"};
}

}  // namespace relievo
