// SPDX-License-Identifier: Apache-2.0
// Frames of 3D video, each codec: the input is split where a frame's magic begins, and one decoder gets all
// of them in turn, so that delta frames find their key frames.
#include <algorithm>
#include <cmath>
#include <string_view>

#include "codec/frame3d_codec.h"
#include "fuzz/fuzz.h"

namespace relievo {
namespace {

void check_sound(const Frame3D& frame) {
  const Surface& s = frame.surface;
  const std::size_t count = s.positions.size();
  for (const Vec3f& p : s.positions)
    for (const float x : p) FUZZ_CHECK(std::isfinite(x));
  for (const Triangle& t : s.triangles)
    for (const std::uint32_t vertex : t) FUZZ_CHECK(vertex < count);
  FUZZ_CHECK(s.normals.empty() || s.normals.size() == count);
  FUZZ_CHECK(s.texture_coordinates.empty() || s.texture_coordinates.size() == count);
  FUZZ_CHECK(s.sigmas_m.empty() || s.sigmas_m.size() == count);
  FUZZ_CHECK(s.interpolated.empty() || s.interpolated.size() == count);
  FUZZ_CHECK(s.grid.empty() || s.grid.size() == count);
}

void decode(std::span<const std::uint8_t> bytes, FrameDecoder& decoder) {
  const auto header = read_frame_header(bytes);
  static_cast<void>(is_key_frame(bytes));
  static_cast<void>(decoder.can_decode(bytes));
  const auto frame = decoder.decode(bytes);
  if (!frame) return;
  FUZZ_CHECK(header.ok());
  FUZZ_CHECK(frame->surface.positions.size() <= header->vertices);
  check_sound(*frame);
}

}  // namespace
}  // namespace relievo

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::string_view kMagic = "RLVF";
  relievo::FrameDecoder decoder;
  std::span<const std::uint8_t> rest(data, size);
  while (!rest.empty()) {
    const auto next = std::search(rest.begin() + 1, rest.end(), kMagic.begin(), kMagic.end());
    const auto length = static_cast<std::size_t>(next - rest.begin());
    relievo::decode(rest.first(length), decoder);
    rest = rest.subspan(length);
  }
  return 0;
}
