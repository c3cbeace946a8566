// SPDX-License-Identifier: Apache-2.0
#include "capture/calibrate/sheet_colours.h"

#include <algorithm>
#include <array>

namespace relievo {

Result<std::vector<Primary>> tell_colours(const std::vector<Image8>& pictures) {
  const Error unclear{
      "the pictures do not show each of the 8 colours once; is the sheet lit by the projector?"};
  if (pictures.size() != 8) return unclear;
  std::vector<std::array<double, 3>> sums;
  for (const Image8& picture : pictures) {
    auto& sum = sums.emplace_back();
    for (std::size_t i = 0; i < picture.size(); ++i) sum[i % 3] += picture.data()[i];
  }
  const auto total = [](const std::array<double, 3>& s) { return s[0] + s[1] + s[2]; };
  const auto [black, white] = std::minmax_element(
      sums.begin(), sums.end(), [&](const auto& a, const auto& b) { return total(a) < total(b); });
  std::vector<Primary> out;
  for (const auto& sum : sums) {
    unsigned colour = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      if (2 * sum[c] > (*black)[c] + (*white)[c]) colour |= 1u << c;
    }
    if (std::find(out.begin(), out.end(), colour) != out.end()) return unclear;
    out.push_back(static_cast<Primary>(colour));
  }
  return out;
}

std::vector<Image8> draw_sheet_colours(int width, int height) {
  std::vector<Image8> out;
  for (const unsigned colour : {0u, 1u, 2u, 4u}) {
    for (const unsigned shown : {colour, 7u - colour}) {
      Image8& picture = out.emplace_back(width, height, 3);
      for (std::size_t i = 0; i < picture.size(); ++i)
        picture.data()[i] = (shown >> (i % 3) & 1u) != 0 ? 255 : 0;
    }
  }
  return out;
}

}  // namespace relievo
