// SPDX-License-Identifier: Apache-2.0
// What a reader tells of a stream's frames by who wrote them: how many were lost on the way, and whether it
// is more than one server.
#pragma once

#include <array>
#include <cstdint>

namespace relievo {

/// Of one stream. One thread.
class FrameOrder {
 public:
  /// Takes a frame of `reader` by its writer's handle. Returns how many since the frame before did not come;
  /// none where that was another writer's.
  std::uint64_t add(std::int32_t reader, std::uint64_t writer, std::uint64_t sequence);

  /// Whether frames came of one server, of another one and of the first again: both are live. A server that
  /// takes another one's place, or is started again, stays.
  bool is_mixed() const { return mixed_; }

 private:
  using Guid = std::array<std::uint8_t, 16>;  // zeros: of none
  bool is_of_same(std::int32_t reader, std::uint64_t handle);

  // The writer of the last frame; none before the first. Its handle is another one after a break of the
  // network that was long enough for DDS to forget it; its guid is the same.
  std::uint64_t handle_ = 0;
  Guid writer_{};
  Guid other_{};  // that of the server before, of which the last frame is not
  std::uint64_t last_sequence_ = 0;
  bool mixed_ = false;
};

}  // namespace relievo
