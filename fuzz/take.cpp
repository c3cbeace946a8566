// SPDX-License-Identifier: Apache-2.0
// A take's files: the first byte says which one of a sound take is replaced by the rest.
#include <stdlib.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <string>

#include "base/log.h"
#include "capture/source/field_source.h"
#include "capture/source/npy.h"
#include "fuzz/fuzz.h"
#include "fuzz/memory_file.h"
#include "tests/support/striped_scene.h"
#include "tests/support/temp_folder.h"

namespace relievo {
namespace {

constexpr std::array kFiles{"rig.yaml", "pattern.yaml", "timestamps.csv", "frames/000000.png",
                            "truth/000000.npy"};

/// Sound but for the file being tried.
class Take {
 public:
  Take() {
    set_log_level(LogLevel::kError);
    FUZZ_CHECK(test::write_striped_take(test::striped_scene(), folder_.path(), 2));
  }
  void try_file(const std::string& name, std::span<const std::uint8_t> bytes) {
    const std::filesystem::path file = folder_ / name;
    const std::filesystem::path sound = folder_ / "sound";
    std::filesystem::rename(file, sound);
    std::ofstream(file, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    if (name.starts_with("truth")) {
      static_cast<void>(read_npy(file).ok());
    } else {
      play();
    }
    std::filesystem::rename(sound, file);
  }

 private:
  void play() const {
    auto source = open_source("take:" + folder_.path().string(), {});
    if (!source) return;
    const PinholeModel& camera = (*source)->info().rig.camera;
    for (int i = 0; i < 3; ++i) {
      const auto frame = (*source)->next();
      if (!frame || !*frame) continue;
      FUZZ_CHECK((*frame)->picture.width() == camera.width && (*frame)->picture.height() == camera.height);
    }
  }

  const test::TempFolder folder_;
};

}  // namespace
}  // namespace relievo

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const int in_memory =
      ::setenv("TMPDIR", relievo::fuzz::folder_in_memory().c_str(), 0);  // before the take is written
  static relievo::Take take;
  FUZZ_CHECK(in_memory == 0);
  if (size == 0 || data[0] >= relievo::kFiles.size()) return 0;
  take.try_file(relievo::kFiles[data[0]], {data + 1, size - 1});
  return 0;
}
