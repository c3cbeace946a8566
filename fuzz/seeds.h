// SPDX-License-Identifier: Apache-2.0
// Sound inputs of fuzz targets, for fuzz_seeds. What goes wrong there ends the program.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

#include "base/result.h"
#include "base/stream.h"

namespace relievo::fuzz {

namespace fs = std::filesystem;

Bytes read_seed(const fs::path& file);
void write_seed(const fs::path& file, std::span<const std::uint8_t> bytes);

// Of the targets that read files and requests, each to a folder of its own; `source` is the repository.
Status take_seeds(const fs::path& source, const fs::path& out);
Status calibration_seeds(const fs::path& source, const fs::path& out);
Status mesh_seeds(const fs::path& source, const fs::path& out);
Status picture_seeds(const fs::path& source, const fs::path& out);
Status config_seeds(const fs::path& source, const fs::path& out);
Status gateway_seeds(const fs::path& source, const fs::path& out);

}  // namespace relievo::fuzz
