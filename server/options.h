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

}  // namespace relievo
