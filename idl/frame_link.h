// SPDX-License-Identifier: Apache-2.0
// What a subscriber reads frames with. Internal to idl/.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "base/result.h"
#include "base/rung.h"
#include "idl/entity.h"

struct ddsi_serdata;

namespace relievo {

/// The serialised bytes of a taken sample, lent without a copy.
class LentBytes {
 public:
  explicit LentBytes(ddsi_serdata* sample);
  LentBytes(const LentBytes&) = delete;
  LentBytes& operator=(const LentBytes&) = delete;
  ~LentBytes();

  std::span<const std::uint8_t> span() const { return bytes_; }

 private:
  ddsi_serdata* reference_;
  std::span<const std::uint8_t> bytes_;
};

/// A reader of the frames of one rung of the ladder, and a condition that holds while it has some.
struct FrameLink {
  Rung rung = Rung::kFull;
  Entity group, reader, condition;

  /// `stream` empty: of all streams, of which there is only the full rung.
  static Result<FrameLink> open(std::int32_t participant, const std::string& stream, Rung rung);
};

}  // namespace relievo
