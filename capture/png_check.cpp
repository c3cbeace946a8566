// SPDX-License-Identifier: Apache-2.0
#include "capture/png_check.h"

#include <array>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>

namespace relievo {
namespace {

std::uint32_t crc32(std::span<const std::uint8_t> data) {
  static const auto table = [] {
    std::array<std::uint32_t, 256> out{};
    for (std::uint32_t i = 0; i < 256; ++i) {
      std::uint32_t c = i;
      for (int k = 0; k < 8; ++k) c = c & 1 ? 0xEDB88320u ^ (c >> 1) : c >> 1;
      out[i] = c;
    }
    return out;
  }();
  std::uint32_t c = 0xFFFFFFFFu;
  for (const std::uint8_t b : data) c = table[(c ^ b) & 255] ^ (c >> 8);
  return ~c;
}

std::uint32_t big_endian(const std::uint8_t* p) {
  return std::uint32_t{p[0]} << 24 | std::uint32_t{p[1]} << 16 | std::uint32_t{p[2]} << 8 | p[3];
}

}  // namespace

Result<PngHeader> check_png(std::span<const std::uint8_t> file) {
  static constexpr std::uint8_t kSignature[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
  if (file.size() < 8 || std::memcmp(file.data(), kSignature, 8) != 0) return Error{"is no PNG file"};
  std::optional<PngHeader> header;
  std::size_t at = 8;
  for (;;) {
    if (file.size() - at < 12) return Error{"is cut short at byte " + std::to_string(at)};
    const std::size_t length = big_endian(&file[at]);
    if (length > file.size() - at - 12)
      return Error{"is cut short in the chunk at byte " + std::to_string(at)};
    const std::span<const std::uint8_t> chunk(&file[at + 4], 4 + length);  // type and data
    if (crc32(chunk) != big_endian(&file[at + 8 + length])) {
      return Error{"is damaged: wrong checksum of the chunk at byte " + std::to_string(at)};
    }
    const std::string_view type(reinterpret_cast<const char*>(chunk.data()), 4);
    if (!header && (type != "IHDR" || length != 13))
      return Error{"is damaged: it does not start with a header"};
    if (!header) header = {big_endian(&chunk[4]), big_endian(&chunk[8]), chunk[12], chunk[13]};
    if (type == "IEND") return *header;
    at += 12 + length;
  }
}

}  // namespace relievo
