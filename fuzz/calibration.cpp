// SPDX-License-Identifier: Apache-2.0
// Files that calibration programs write, ours and others'.
#include "base/rig.h"
#include "capture/calibrate/rig_import.h"
#include "capture/calibrate/rig_part.h"
#include "capture/rig_file.h"
#include "fuzz/fuzz.h"
#include "fuzz/memory_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace relievo;
  const fuzz::MemoryFile file({data, size});
  for (const auto& [width, height] : {std::pair{0, 0}, {1024, 768}}) {
    const auto imported = import_rig(file.path(), width, height);
    if (!imported) continue;
    const std::string text = to_yaml(imported->rig);
    const fuzz::MemoryFile written({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
    FUZZ_CHECK(read_rig(written.path()).ok());
  }
  if (const auto part = read_rig_part(file.path())) FUZZ_CHECK(part->colours.has_value());
  static_cast<void>(read_pattern(file.path()).ok());
  return 0;
}
