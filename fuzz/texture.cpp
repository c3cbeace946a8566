// SPDX-License-Identifier: Apache-2.0
// Textures: a byte each of codec and number of pictures, two each of width and height as a frame declares
// them, then pictures, each with two bytes of its length. One decoder gets all of them, so that pictures find
// those they build on.
#include "codec/texture_codec.h"

#include "codec/byte_io.h"
#include "fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace relievo;
  ByteReader reader({data, size});
  const auto codec = static_cast<TextureCodec>(reader.read<std::uint8_t>());
  const auto count = reader.read<std::uint8_t>();
  const auto width = reader.read<std::uint16_t>();
  const auto height = reader.read<std::uint16_t>();
  const auto decoder = make_texture_decoder(codec);
  if (decoder == nullptr) return 0;
  const std::uint64_t pixels = std::uint64_t{width} * height;
  for (int i = 0; i < count && reader.ok(); ++i) {
    const auto section = reader.take(reader.read<std::uint16_t>());
    if (section.empty() || pixels > most_texture_pixels_per_byte(codec) * section.size()) continue;
    static_cast<void>(texture_is_key(codec, section));
    static_cast<void>(decoder->can_decode(section));
    Image8 picture;
    if (i % 3 == 2) {
      static_cast<void>(decoder->remember(section, width, height).ok());
    } else if (decoder->decode(section, width, height, picture)) {
      FUZZ_CHECK(picture.width() == width && picture.height() == height && picture.channels() == 3);
    }
  }
  return 0;
}
