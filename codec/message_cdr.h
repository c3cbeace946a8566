// SPDX-License-Identifier: Apache-2.0
// Messages of other programs' schemas as CDR: what generic viewers and ROS 2 read.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <span>
#include <string_view>
#include <utility>

#include "base/rig.h"
#include "codec/byte_io.h"

namespace relievo {

/// XCDR version 1, little endian: values are aligned to their size, counted from behind the encapsulation
/// header. One thread.
class MessageCdr {
 public:
  template <Scalar T>
  void put(T value) {
    const std::size_t body = bytes_.size() - kEncapsulationBytes;
    bytes_.resize(kEncapsulationBytes + (body + sizeof(T) - 1) / sizeof(T) * sizeof(T));
    append(bytes_, value);
  }
  void text(std::string_view text);
  void octets(std::span<const std::uint8_t> octets);
  /// Seconds and nanoseconds, 32 bits each. None before 1970.
  void time(std::int64_t ns);
  void empty_sequences(int count) {
    for (int i = 0; i < count; ++i) put(std::uint32_t{0});
  }
  void numbers(std::span<const double> values) {
    for (const double value : values) put(value);
  }
  void numbers(std::initializer_list<double> values) { numbers(std::span(values.begin(), values.size())); }
  /// "plumb_bob", D, K, R and P of one camera alone, as ROS and Foxglove both have them in a row.
  void calibration(const PinholeModel& camera);
  Bytes take() { return std::move(bytes_); }

 private:
  static constexpr std::size_t kEncapsulationBytes = 4;
  Bytes bytes_{0, 1, 0, 0};
};

}  // namespace relievo
