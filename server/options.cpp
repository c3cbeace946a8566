// SPDX-License-Identifier: Apache-2.0
#include "server/options.h"

#include <CLI/CLI.hpp>
#include <map>

namespace relievo {

void add_decoder_option(CLI::App& app, Decoder& decoder) {
  const std::map<std::string, Decoder> names{{"ordered", Decoder::kOrdered}, {"paper", Decoder::kPaper}};
  app.add_option("--decoder", decoder,
                 "ordered (by the sequence along and across lines) or paper (as published)")
      ->transform(CLI::CheckedTransformer(names).description(""))
      ->type_name("NAME");
}

}  // namespace relievo
