// SPDX-License-Identifier: Apache-2.0
// Gray-code pictures of a projector that was larger than is said.
#pragma once

#include <string>

#include "capture/pattern/gray_decode.h"

namespace relievo {

/// Where lit pixels see places outside of the stack's projector, and more than noise does: a sentence that
/// says so. Empty else. What they see inside fits as if all were well.
std::string beyond_projector(const GrayStack& stack, const GrayDecodeOptions& options);

}  // namespace relievo
