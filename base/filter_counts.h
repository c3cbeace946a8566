// SPDX-License-Identifier: Apache-2.0
// What each filter between the detected boundaries and the surface did: so that nothing disappears unsaid.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace relievo {

struct FilterCounts {
  std::uint64_t unsupported = 0, completed = 0, traced = 0, rejected = 0, moved = 0, no_point = 0,
                duplicate = 0, filled = 0, interpolated = 0, alone = 0, step = 0, edge_on = 0,
                small_component = 0, recovered = 0, fronts = 0;

  FilterCounts& operator+=(const FilterCounts& other);
  bool operator==(const FilterCounts&) const = default;
};

/// Names are those of JSON and metrics, never renamed; their order is that on the network: new ones come
/// last.
struct Filter {
  std::string_view name;
  std::string_view meaning;
  std::uint64_t FilterCounts::*count;
};
inline constexpr std::array<Filter, 15> kFilters{{
    {"unsupported", "decoded boundaries given up, since no neighbouring line agreed",
     &FilterCounts::unsupported},
    {"completed", "boundaries decoded by the lines above and below", &FilterCounts::completed},
    {"traced", "boundaries seen only by averaging along those on the lines around", &FilterCounts::traced},
    {"rejected", "decoded boundaries given up, since no surface passes through them",
     &FilterCounts::rejected},
    {"moved", "boundaries beside a depth step put back on their surface", &FilterCounts::moved},
    {"no_point", "decoded boundaries whose ray and light sheet do not meet", &FilterCounts::no_point},
    {"duplicate", "points at a grid place that a better one has", &FilterCounts::duplicate},
    {"filled", "grid places filled in", &FilterCounts::filled},
    {"interpolated", "pixels interpolated between boundaries", &FilterCounts::interpolated},
    {"alone", "boundaries left out of the dense surface, with no other beside them", &FilterCounts::alone},
    {"step", "triangles not made, since they would bridge a depth step", &FilterCounts::step},
    {"edge_on", "triangles not made, since they are seen edge-on", &FilterCounts::edge_on},
    {"small_component", "points left out in pieces too small to be a surface",
     &FilterCounts::small_component},
    {"recovered", "boundaries found by their surface, luma or the frame before, or twice on their line",
     &FilterCounts::recovered},
    {"fronts", "last boundaries of a surface that had been taken for some of what is behind it",
     &FilterCounts::fronts},
}};

inline FilterCounts& FilterCounts::operator+=(const FilterCounts& other) {
  for (const Filter& filter : kFilters) this->*filter.count += other.*filter.count;
  return *this;
}

}  // namespace relievo
