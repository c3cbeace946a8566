// SPDX-License-Identifier: Apache-2.0
#include "server/options.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <string>

namespace relievo {

void add_decoder_option(CLI::App& app, Decoder& decoder) {
  app.add_option_function<std::string>(
         "--decoder", [&decoder](const std::string& name) { decoder = decoder_named(name).value(); },
         "ordered (by the sequence along and across lines: the best), quick (the same with less care, in a "
         "fraction of its time) or paper (as published)")
      ->check([](const std::string& name) {
        return decoder_named(name) ? std::string() : "give ordered, quick or paper, not '" + name + "'";
      })
      ->default_str(std::string(decoder_name(decoder)))
      ->type_name("NAME");
}

void add_half_lines_option(CLI::App& app, int& line_stride) {
  app.add_flag_callback(
      "--half-lines", [&line_stride] { line_stride = 2; }, kHalfLinesHelp);
}

void add_surface_options(CLI::App& app, SurfaceBuilderOptions& options) {
  app.add_flag("--dense", options.dense,
               "A vertex at each pixel of a line, interpolated between boundaries of one surface");
  app.add_option("--fill-holes", options.fill_holes,
                 "Bridge so many missing boundaries or lines of one surface (default 0: none)")
      ->check(CLI::Range(0, kMostFilled))
      ->type_name("N");
}

void print_filters(const FilterCounts& counts, std::uint64_t frames) {
  for (const Filter& filter : kFilters) {
    const double each = static_cast<double>(counts.*filter.count) / static_cast<double>(frames);
    if (each > 0)
      std::printf("  %-16s %8.1f a frame: %s\n", std::string(filter.name).c_str(), each,
                  std::string(filter.meaning).c_str());
  }
}

void add_scheme_option(CLI::App& app, std::string& scheme) {
  app.add_option("--scheme", scheme, "What a simulated projector shows in turn: " + scheme_names())
      ->check([](const std::string& name) { return scheme_named(name) ? "" : "give " + scheme_names(); })
      ->type_name("NAME");
}

Result<std::string> with_scheme(const std::string& source, const std::string& scheme) {
  if (scheme.empty()) return source;
  if (!source.starts_with("sim:"))
    return Error{"--scheme is for simulated sources: what " + source +
                 " was filmed under, its pattern.yaml says"};
  if (source.find(",scheme=") != std::string::npos)
    return Error{"the scheme is said twice, by --scheme " + scheme + " and in " + source + ": leave one out"};
  return source + ",scheme=" + scheme;
}

FieldOrder field_order_named(const std::string& name) {
  return name == "bottom" ? FieldOrder::kBottom : FieldOrder::kTop;
}

const char* scheme_help() {
  return "Schemes (rates at 29.97 frames a second; docs/SCHEMES.md):\n"
         "  complementary  slide 1 and its complement, slide 2 and its complement: texture 30 Hz, geometry "
         "30\n"
         "                 Hz; colours near stripe edges suffer\n"
         "  white-field    slide 1, white, slide 2, white: texture 30 Hz and clean, geometry 60 Hz; ambient\n"
         "                 light and noise cost depth precision\n"
         "  white-frame    as complementary, then one white frame: geometry 20 Hz, texture 10 Hz and best;\n"
         "                 fast motion suffers\n"
         "  one-slide      one slide and its complement, both 30 Hz, each frame by itself: any motion; "
         "codes\n"
         "                 repeat, so small surfaces may be misplaced\n";
}

}  // namespace relievo
