// SPDX-License-Identifier: Apache-2.0
// What a connection says that wants nothing: the same every time.
#pragma once

#include <cstdint>
#include <string>

namespace relievo::test {

/// The `number`th: begins as a request, as TLS, or as nothing, and has no end.
inline std::string noise(int number) {
  std::string text = number % 3 == 0 ? "GET / HTTP/1.1\r\nX: " : number % 3 == 1 ? "\x16\x03\x01" : "x";
  auto random = static_cast<std::uint32_t>(number) + 7;
  for (int i = 0; i < 40; ++i) {
    random = random * 1664525u + 1013904223u;
    text += static_cast<char>(random >> 24);
  }
  return text;
}

}  // namespace relievo::test
