// SPDX-License-Identifier: Apache-2.0
#include "server/options.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <map>
#include <string>

namespace relievo {

void add_decoder_option(CLI::App& app, Decoder& decoder) {
  const std::map<std::string, Decoder> names{{"ordered", Decoder::kOrdered}, {"paper", Decoder::kPaper}};
  app.add_option("--decoder", decoder,
                 "ordered (by the sequence along and across lines) or paper (as published)")
      ->transform(CLI::CheckedTransformer(names).description(""))
      ->type_name("NAME");
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

}  // namespace relievo
