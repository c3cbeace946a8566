// SPDX-License-Identifier: Apache-2.0
#include "base/clock_steps.h"

#include <cstdlib>
#include <optional>

#include "base/time.h"

namespace relievo {
namespace {

constexpr std::int64_t kStep_ns = 10'000'000;
constexpr std::int64_t kTogether_ns = 1'000'000;  // longer between two looks tells of the scheduler
constexpr int kLooks = 10;

/// Nothing where this thread was kept from reading both at one moment.
std::optional<std::int64_t> difference_ns() {
  for (int i = 0; i < kLooks; ++i) {
    const std::int64_t before_ns = steady_now_ns(), utc_ns = utc_now_ns(), after_ns = steady_now_ns();
    if (after_ns - before_ns <= kTogether_ns) return utc_ns - before_ns;
  }
  return std::nullopt;
}

}  // namespace

ClockSteps::ClockSteps() {
  begun_ns_ = now_ns_ = difference_ns().value_or(utc_now_ns() - steady_now_ns());
}

std::int64_t ClockSteps::utc_from_steady_ns() {
  if (const auto seen_ns = difference_ns(); seen_ns && std::llabs(*seen_ns - now_ns_) > kStep_ns)
    now_ns_ = *seen_ns;
  return now_ns_;
}

}  // namespace relievo
