// SPDX-License-Identifier: Apache-2.0
// How --help looks.
#pragma once

#include <memory>

namespace CLI {
class FormatterBase;
}

namespace relievo {

/// What an option takes shows as its kind, its choices or its range; defaults stand behind the description.
std::shared_ptr<CLI::FormatterBase> make_help_formatter();

}  // namespace relievo
