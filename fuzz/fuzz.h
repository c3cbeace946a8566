// SPDX-License-Identifier: Apache-2.0
// A fuzz target: one function, which libFuzzer or replay.cpp calls. What it finds is a crash, a failed
// FUZZ_CHECK, a sanitizer's report, a hang or too much memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

/// What a decoder promises of anything it accepts; stays in release builds.
#define FUZZ_CHECK(condition)                                              \
  do {                                                                     \
    if (!(condition)) {                                                    \
      std::fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                        \
    }                                                                      \
  } while (false)
