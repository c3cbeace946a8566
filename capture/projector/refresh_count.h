// SPDX-License-Identifier: Apache-2.0
// Refreshes that went by and those at which a picture was missed: from the display's own count where it has
// one, else from the times at which pictures came. No clock of its own.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "capture/projector/display.h"

namespace relievo {

class RefreshCount {
 public:
  /// Each picture is to stay for `each` refreshes of about `refresh_hz` (0: not known).
  RefreshCount(double refresh_hz, int each);

  /// A picture came onto the screen. Returns the refreshes since the first one, this one included: 0 for the
  /// first; pictures times `each` where none was missed. Where the display does not wait for its refresh,
  /// what it would have been had it: pictures that come early take no less than their time.
  std::uint64_t flip(const Flip& flip);

  std::uint64_t pictures() const { return pictures_; }
  std::uint64_t refreshes() const { return refreshes_; }
  std::uint64_t missed() const { return missed_; }  // refreshes at which a new picture was due and none came
  /// Measured, over the last seconds; what the constructor was told until then.
  double refresh_hz() const;
  /// False once pictures have come so fast that the display cannot be waiting for its refresh.
  bool synchronised() const { return synchronised_; }

 private:
  double median_interval_ns() const;

  double told_hz_;
  int each_;
  std::uint64_t pictures_ = 0;
  std::uint64_t refreshes_ = 0;
  std::uint64_t missed_ = 0;
  bool synchronised_ = true;
  std::optional<Flip> last_;
  std::array<std::int64_t, 128> intervals_ns_{};  // ring, a picture each
  std::array<std::uint64_t, 128> passed_{};       // refreshes in each of them
  std::size_t measured_ = 0;
};

}  // namespace relievo
