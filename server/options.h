// SPDX-License-Identifier: Apache-2.0
// Options that several commands share.
#pragma once

#include "capture/reconstruct/reconstructor.h"

namespace CLI {
class App;
}

namespace relievo {

/// --decoder ordered|paper. `decoder` must outlive the parsing.
void add_decoder_option(CLI::App& app, Decoder& decoder);

/// --dense and --fill-holes. `options` must outlive the parsing.
void add_surface_options(CLI::App& app, SurfaceBuilderOptions& options);

/// For people: the filters that did something, one a line, a frame's share.
void print_filters(const FilterCounts& counts, std::uint64_t frames);

}  // namespace relievo
