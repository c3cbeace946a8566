// SPDX-License-Identifier: Apache-2.0
// Options that several commands share.
#pragma once

#include <string>

#include "base/result.h"
#include "capture/reconstruct/reconstructor.h"

namespace CLI {
class App;
}

namespace relievo {

/// --decoder ordered|paper. `decoder` must outlive the parsing.
void add_decoder_option(CLI::App& app, Decoder& decoder);

inline constexpr const char* kHalfLinesHelp =
    "Reconstruct every second line alone, in little more than half the time";
/// --half-lines, which makes `line_stride` 2. It must outlive the parsing.
void add_half_lines_option(CLI::App& app, int& line_stride);

/// --dense and --fill-holes. `options` must outlive the parsing.
void add_surface_options(CLI::App& app, SurfaceBuilderOptions& options);

/// For people: the filters that did something, one a line, a frame's share.
void print_filters(const FilterCounts& counts, std::uint64_t frames);

/// --scheme NAME of a simulated source: "", or a projection scheme's name. `scheme` must outlive the parsing.
void add_scheme_option(CLI::App& app, std::string& scheme);

/// `source` filmed under `scheme`, where that is not empty. Fails where the source says its own scheme: a
/// take's pattern.yaml does, and so does a simulated source's key.
Result<std::string> with_scheme(const std::string& source, const std::string& scheme);

/// Of "bottom" or "top", as --field-order has it.
FieldOrder field_order_named(const std::string& name);

/// The projection schemes with their rates and weaknesses, for help texts.
const char* scheme_help();

}  // namespace relievo
