// SPDX-License-Identifier: Apache-2.0
// What a subscriber reads frames with. Internal to idl/.
#pragma once

#include <cstdint>
#include <optional>
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

/// Asks the server for the frames of the slow rung, one after the other: no more are under way than the way
/// carries. One thread.
class FrameAsker {
 public:
  static Result<FrameAsker> open(std::int32_t participant, const std::string& stream);

  /// A frame came: the next one is asked for.
  void got(std::int64_t now_ns);
  /// Asks again where none came for long: less and less often, since it may be under way yet.
  void tick(std::int64_t now_ns);

 private:
  void ask(std::int64_t now_ns);

  std::string stream_;
  Entity group_, writer_;
  std::int64_t asked_ns_ = 0;
  std::int64_t wait_ns_ = 0;  // until it asks again
};

/// A reader of the frames of one rung of the ladder, and a condition that holds while it has some.
struct FrameLink {
  Rung rung = Rung::kFull;
  Entity group, reader, condition;
  std::optional<FrameAsker> asker;  // of kSlow

  /// `stream` empty: of all streams, of which there is only the full rung.
  static Result<FrameLink> open(std::int32_t participant, const std::string& stream, Rung rung);
};

}  // namespace relievo
