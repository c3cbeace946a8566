// SPDX-License-Identifier: Apache-2.0
// A configuration as `serve --config` reads it, from a text.
#pragma once

#include <fstream>
#include <string>

#include "server/config.h"
#include "tests/support/temp_folder.h"

namespace relievo::test {

struct Read {
  Status status;
  ServeConfig config;
  std::string file;
};

inline Read read(const std::string& text) {
  const TempFolder folder;
  const auto file = folder / "serve.toml";
  std::ofstream(file, std::ios::binary) << text;
  Read out;
  out.file = file.string();
  out.status = read_config(file, out.config);
  return out;
}

}  // namespace relievo::test
