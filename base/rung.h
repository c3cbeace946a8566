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
};

inline constexpr std::array<Rung, 4> kRungs = {Rung::kFull, Rung::kReduced, Rung::kTexture, Rung::kSlow};
/// Those of WebSocket clients, which ask for each frame on every rung.
inline constexpr std::array<Rung, 3> kWebRungs = {Rung::kFull, Rung::kReduced, Rung::kTexture};

/// "full", "reduced", "texture" or "slow".
constexpr std::string_view to_string(Rung rung) {
  constexpr std::array<std::string_view, kRungs.size()> kNames = {"full", "reduced", "texture", "slow"};
  return kNames[static_cast<std::size_t>(rung)];
}
constexpr std::optional<Rung> rung_named(std::string_view name) {
  for (const Rung rung : kRungs)
    if (to_string(rung) == name) return rung;
  return std::nullopt;
}

}  // namespace relievo
