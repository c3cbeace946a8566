// SPDX-License-Identifier: Apache-2.0
// The quality ladder: in how much detail a stream is to be had, from its best rung down.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace relievo {

enum class Rung : std::uint8_t {
  kFull,     // the stream itself
  kReduced,  // every second line of the surface, half the texture's width and height
  kTexture,  // that texture alone
  kSlow,     // likewise, one frame whenever its readers have asked for one: what their way carries
  // The first three with JPEG textures, where the stream's are H.264: for who decodes no video.
  kFullJpeg,
  kReducedJpeg,
  kTextureJpeg,
};

inline constexpr std::array<Rung, 7> kRungs = {Rung::kFull,       Rung::kReduced,  Rung::kTexture,
                                               Rung::kSlow,       Rung::kFullJpeg, Rung::kReducedJpeg,
                                               Rung::kTextureJpeg};
/// Those that WebSocket clients choose from, which ask for each frame on every rung; each may be had as JPEG.
inline constexpr std::array<Rung, 3> kWebRungs = {Rung::kFull, Rung::kReduced, Rung::kTexture};

/// "full", "reduced", "texture", "slow", "full-jpeg", "reduced-jpeg" or "texture-jpeg".
constexpr std::string_view to_string(Rung rung) {
  constexpr std::array<std::string_view, kRungs.size()> kNames = {
      "full", "reduced", "texture", "slow", "full-jpeg", "reduced-jpeg", "texture-jpeg"};
  return kNames[static_cast<std::size_t>(rung)];
}
constexpr std::optional<Rung> rung_named(std::string_view name) {
  for (const Rung rung : kRungs)
    if (to_string(rung) == name) return rung;
  return std::nullopt;
}

constexpr bool is_jpeg(Rung rung) {
  return rung >= Rung::kFullJpeg;
}
/// The one of the same detail with JPEG textures; nothing of kSlow.
constexpr std::optional<Rung> jpeg_of(Rung rung) {
  if (rung == Rung::kSlow) return std::nullopt;
  constexpr int kApart = static_cast<int>(Rung::kFullJpeg) - static_cast<int>(Rung::kFull);
  return is_jpeg(rung) ? rung : static_cast<Rung>(static_cast<int>(rung) + kApart);
}
/// How much detail it has, whatever its textures are: never one of the JPEG rungs.
constexpr Rung detail_of(Rung rung) {
  for (const Rung plain : kWebRungs)
    if (jpeg_of(plain) == rung) return plain;
  return rung;
}

}  // namespace relievo
