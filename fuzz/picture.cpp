// SPDX-License-Identifier: Apache-2.0
// Pictures of a folder, of every format that is read, and where the first byte is not 0 a camera's JPEG.
#include "capture/picture_file.h"

#include "capture/source/v4l2/to_rgb.h"
#include "fuzz/fuzz.h"
#include "fuzz/memory_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace relievo;
  if (size == 0) return 0;
  const std::span<const std::uint8_t> bytes(data + 1, size - 1);
  if (data[0] == 0) {
    const fuzz::MemoryFile file(bytes);
    const auto picture = read_rgb(file.path());
    if (!picture) return 0;
    FUZZ_CHECK(picture->channels() == 3 && picture->size() > 0);
    FUZZ_CHECK(picture->size() <= 3 * kMostPicturePixels);
    FUZZ_CHECK(picture->size() <= 3 * kMostPicturePixelsPerByte * bytes.size());
  } else {
    constexpr int kWidth = 40, kHeight = 24;  // the camera's
    Image8 out(kWidth, kHeight, 3);
    v4l2::RawView raw{.planes = {}, .width = kWidth, .height = kHeight, .coding = {}};
    raw.planes[0] = {.data = bytes.data(), .stride = 0, .bytes = bytes.size()};
    static_cast<void>(v4l2::jpeg_to_rgb(raw, {.data = out.data(), .stride = out.stride()}).ok());
  }
  return 0;
}
