// SPDX-License-Identifier: Apache-2.0
// How long tests wait. A test says in which order things happen, never how soon: a slow or loaded machine may
// take its time, and only what never comes is a failure.
#pragma once

#include <chrono>
#include <thread>

namespace relievo::test {

using namespace std::chrono_literals;

/// For anything that happens by itself.
constexpr auto kPatience = 60s;
/// For a program that computes all the while: calibrates, renders, scores.
constexpr auto kLongPatience = 300s;

/// Waits until `condition()`; false where it does not come true within `patience`.
template <typename Condition>
bool eventually(const Condition& condition, std::chrono::milliseconds patience = kPatience) {
  const auto end = std::chrono::steady_clock::now() + patience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(5ms);
  }
  return true;
}

}  // namespace relievo::test
