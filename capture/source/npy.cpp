// SPDX-License-Identifier: Apache-2.0
#include "capture/source/npy.h"

#include <bit>
#include <cstdio>
#include <cstring>
#include <string>

#include "base/whole_file.h"

namespace relievo {
namespace {

static_assert(std::endian::native == std::endian::little, "truth is written as it lies in memory");

constexpr char kMagic[] = "\x93NUMPY\x01";  // and a zero: version 1.0
constexpr std::size_t kPreamble = 10;       // magic, version, length of the header
constexpr std::size_t kMostBytes = (std::size_t{1} << 30) + (1 << 17);  // of the largest picture

}  // namespace

Result<ImageF> read_npy(const std::filesystem::path& file) {
  const std::string name = file.string();
  const auto content = read_whole_file(file, kMostBytes);
  if (!content) return content.error();
  if (content->size() < kPreamble || std::memcmp(content->data(), kMagic, 8) != 0) {
    return Error{name + " is no .npy file of version 1.0"};
  }
  const auto byte = [&](std::size_t i) {
    return static_cast<std::size_t>(static_cast<unsigned char>((*content)[i]));
  };
  const std::string header = content->substr(kPreamble, byte(8) + 256 * byte(9));
  const std::size_t shape = header.find("'shape': (");
  int height = 0, width = 0, used = 0;
  if (header.find("'<f4'") == std::string::npos ||
      header.find("'fortran_order': False") == std::string::npos || shape == std::string::npos ||
      std::sscanf(header.c_str() + shape, "'shape': (%d, %d)%n", &height, &width, &used) != 2 || used == 0 ||
      height <= 0 || width <= 0 || height > 1 << 14 || width > 1 << 14) {
    return Error{name + " must hold float32 of shape (height, width) in C order"};
  }
  const std::size_t at = kPreamble + header.size();
  const auto bytes = static_cast<std::uintmax_t>(height) * static_cast<std::uintmax_t>(width) * sizeof(float);
  if (content->size() - at != bytes) return Error{name + " does not have the size that its header says"};
  ImageF image(width, height, 1);
  std::memcpy(image.data(), content->data() + at, content->size() - at);
  return image;
}

Status write_npy(const std::filesystem::path& file, const ImageF& image) {
  std::string header = "{'descr': '<f4', 'fortran_order': False, 'shape': (" +
                       std::to_string(image.height()) + ", " + std::to_string(image.width()) + "), }";
  header.append(64 - (kPreamble + header.size() + 1) % 64, ' ');  // data aligned to 64 bytes
  header += '\n';
  std::string out(kMagic, 8);
  out.reserve(kPreamble + header.size() + image.size() * sizeof(float));
  out += static_cast<char>(header.size() & 255);
  out += static_cast<char>(header.size() >> 8);
  out += header;
  out.append(reinterpret_cast<const char*>(image.data()), image.size() * sizeof(float));
  return write_whole_file(file, out);
}

}  // namespace relievo
