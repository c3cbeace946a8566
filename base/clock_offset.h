// SPDX-License-Identifier: Apache-2.0
// How far another machine's clock is ahead of this one's, from questions and answers between them (as NTP
// does it: RFC 5905, 8 and 10).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace relievo {

/// Four stamps of one exchange, UTC: asked by our clock, heard and answered by theirs, heard by ours.
struct ClockExchange {
  std::int64_t asked_ns = 0;
  std::int64_t heard_ns = 0;
  std::int64_t answered_ns = 0;
  std::int64_t returned_ns = 0;
};

struct ClockOffset {
  std::int64_t offset_ns = 0;  // to add to our time for theirs
  std::int64_t delay_ns = 0;   // of the way there and back: the offset is right within half of it
};

/// The exchange with the shortest way of the last few: a queue on either side makes ways longer and lopsided,
/// never shorter. One thread.
class ClockEstimate {
 public:
  /// Ignored where the stamps are impossible (back before it was asked, or after less than it took there).
  void add(const ClockExchange& exchange);
  /// Nothing before the first exchange.
  std::optional<ClockOffset> best() const;

  static constexpr std::size_t kExchanges = 16;

 private:
  std::array<ClockOffset, kExchanges> last_{};
  std::size_t count_ = 0;  // so far
};

}  // namespace relievo
