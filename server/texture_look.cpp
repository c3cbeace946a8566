// SPDX-License-Identifier: Apache-2.0
#include "server/texture_look.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "codec/frame_layout.h"
#include "codec/texture_codec.h"

namespace relievo {
namespace {

constexpr double kLossless_db = 99;

}  // namespace

std::optional<double> texture_db(const Bytes& frame, const Image8& picture) {
  const auto layout = read_frame_layout(frame);
  if (!layout || layout->sections.texture.empty()) return std::nullopt;
  const FrameHeader& header = layout->header;
  if (!texture_is_key(header.texture, layout->sections.texture)) return std::nullopt;
  const auto decoder = make_texture_decoder(header.texture);
  Image8 shown;
  if (!decoder ||
      !decoder->decode(layout->sections.texture, header.texture_width, header.texture_height, shown) ||
      shown.size() != picture.size())
    return std::nullopt;
  std::int64_t squares = 0;
  for (std::size_t i = 0; i < picture.size(); ++i) {
    const int d = picture.data()[i] - shown.data()[i];
    squares += d * d;
  }
  if (squares == 0) return kLossless_db;
  const double mean = static_cast<double>(squares) / static_cast<double>(picture.size());
  return std::min(kLossless_db, 10 * std::log10(255.0 * 255.0 / mean));
}

}  // namespace relievo
